"""What the messages of ``identify`` and ``check`` advise is done here, and works."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from monitor_core.arrays import Floats
from monitor_core.modeling import SimulatedAxis
from service.commands.commissioning.axis import axis_calibration, identification_task
from service.commands.commissioning.axis.identification_task import Request, prepare
from service.config import drive_of, given_values, load
from service.config.axis_settings import AxisError
from service.config.written.commissioned import Found, commissioned
from service.reports.formats import Provenance
from service.reports.identification_files import as_toml
from tests.end_to_end.processes import edit
from tests.service.command_line import axiswatch, shown
from tests.service.commands.identify.conftest import write_robot

pytestmark = pytest.mark.usefixtures("without_pictures")

H = 0.005
TIMES = np.arange(round(16 / H)) * H
SLOW = 0.3 * np.sin(2 * np.pi * TIMES / 20)
"""rad/s: within the speed scale of Coulomb friction, which then looks like viscous friction."""
STEADY = np.full(TIMES.size, 6.0)
SEVERAL_SPEEDS = 6 * np.sin(2 * np.pi * TIMES / 4) + 3 * np.sin(2 * np.pi * TIMES / 1.1)
OUTLOOK = re.compile(r"(?:Can be watched|Nothing can be watched).*")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with robot.toml, whose axis has Coulomb friction and true nominal values, in which commands run."""
    write_robot(tmp_path, {"fc": 0.08})
    edit(tmp_path / "robot.toml", ("initial_p = ", "#initial_p = "))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plant_of(folder: Path) -> SimulatedAxis:
    axis = load(folder / "robot.toml", {}).axes[0].config
    return SimulatedAxis(given_values(axis), 1.0, drive=drive_of(axis, "angle"))


def recorded(
    folder: Path, name: str, seed: int, commanded: Callable[[int, float], float], samples: int, coarse: float
) -> str:
    """A table of the true axis that gets a torque by sample and speed; ``coarse``: noise of the angle, rad."""
    plant, rng, rows = plant_of(folder), np.random.default_rng(seed), list[tuple[float, float, float]]()
    for k in range(samples):
        u = commanded(k, plant.speed)
        rows.append((k * H, u, plant.angle + coarse * rng.standard_normal()))
        plant.step(u + 0.02 * rng.standard_normal(), H)
    lines = "".join(f"{t:.6f},{u:.10g},{y:.13g}\n" for t, u, y in rows)
    (folder / name).write_text("t,torque,angle\n" + lines, encoding="utf-8")
    return name


def followed(folder: Path, name: str, seed: int, reference: Floats, coarse: float = 1e-4) -> str:
    """A table of the true axis whose speed is controlled."""
    total = 0.0

    def commanded(k: int, speed: float) -> float:
        nonlocal total
        total += 0.002 * (reference[k] - speed)
        return float(np.clip(0.05 * (reference[k] - speed) + total, -3, 3))

    return recorded(folder, name, seed, commanded, reference.size, coarse)


def identified(*words: str, free: str = "Jm,Ja,fm,fc") -> str:
    """What is printed."""
    start = ("identify", "--config", "robot.toml", "--start", "values", "--force")
    result = axiswatch(*start, *(("--free", free) if free else ()), *words)
    assert result.exit_code == 0, result.output
    return result.output


def outlook(*words: str, free: str = "Jm,Ja,fm,fc") -> str:
    """The first line: what can be watched, and what would give the rest."""
    return str(OUTLOOK.findall(identified(*words, free=free))[-1])


@pytest.mark.soak
def test_motion_at_several_speeds_distinguishes_frictions(folder: Path, seed: int) -> None:
    first = outlook(followed(folder, "slow.csv", seed, SLOW))
    lost = re.search(r"Cannot: fm, .* record motion at several speeds, slow and fast, in both directions", first)
    assert lost, first
    again = outlook("slow.csv", followed(folder, "more.csv", seed + 1, SEVERAL_SPEEDS))
    assert "fm (changes from" in again
    assert "Cannot" not in again


def test_the_motion_that_excite_plans_shows_the_inertia(folder: Path, seed: int) -> None:
    first = outlook(followed(folder, "steady.csv", seed, STEADY, coarse=5e-3))
    advice = re.search(r"Cannot: 1/Ja.*record the motion that `axiswatch (excite --find 1/Ja)` plans", first)
    assert advice, first
    shown(
        *advice[1].split(),
        "--config",
        "robot.toml",
        "--seconds",
        "8",
        "--torque-limit",
        "3",
        "-o",
        "plan.csv",
    )
    torque = np.genfromtxt("plan.csv", delimiter=",", names=True)["torque_Nm"]
    planned = recorded(folder, "planned.csv", seed, lambda k, _: float(torque[k]), torque.size, coarse=5e-3)
    again = outlook(planned)
    assert "1/Ja (changes from" in again
    assert "Cannot: 1/Ja" not in again
    # What the motion alone shows is not asked of the other record alone.
    both = identified("steady.csv", planned, free="")
    assert "1/Ja (changes from" in both
    assert "good fit" in both


def test_commissioning_plans_the_motion_that_is_missing(
    folder: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within the limits of the record.  The command that plans another one works, too."""

    def calibrate(*_: object) -> None:
        raise AxisError("left out here")

    monkeypatch.setattr(axis_calibration, "calibrate_axis", calibrate)
    request = partial(Request, free=("Jm", "Ja", "fm", "fc"), start="values")
    monkeypatch.setattr(identification_task, "Request", request)
    record = followed(folder, "slow.csv", seed, SLOW)
    result = axiswatch("commission", record, "--config", "robot.toml", "--output", "made")
    file = "made/motion/demo.axis1.csv"
    assert f"demo.axis1: to show fm, too, let the controller run the motion in {file} (" in result.output
    assert "`axiswatch commission slow.csv RECORD --config robot.toml --budget 1y --output made`" in result.output
    most = abs(np.genfromtxt("slow.csv", delimiter=",", names=True)["torque"]).max()
    planned = abs(np.genfromtxt(file, delimiter=",", names=True)["torque_Nm"])
    assert 0.5 * most < planned.max() <= 1.001 * most
    assert planned[[0, -1]].max() < 0.1 * most, "from rest and back to it"
    command = re.search("`axiswatch (excite .+)` plans another one", result.output)
    assert command
    assert "--find fm " in command[1]
    assert f" {most:.3g} N m " in shown(*shlex.split(command[1]), "--seconds", 4)
    assert abs(np.genfromtxt(file, delimiter=",", names=True)["torque_Nm"]).max() != planned.max()


@pytest.mark.soak
def test_the_size_of_a_change_of_what_is_zero(folder: Path, seed: int) -> None:
    """tau0 is configured, and the records show none."""
    record = followed(folder, "record.csv", seed, SEVERAL_SPEEDS)
    edit(folder / "robot.toml", ("tau0 = 0.0", "tau0 = 0.02"), ('"1/Ja", "fm"]', '"fm", "tau0"]'))
    first = outlook(record, free="Jm,Ja,fm,fc,tau0")
    advice = re.search(
        r"Cannot: tau0, .* from zero: .*give the size of a change in (\[robot.axis.model.scales\])",
        first,
    )
    assert advice, first
    edit(
        folder / "robot.toml",
        ("[robot.axis.model.nominal]", f"{advice[1]}\ntau0 = 0.02\n\n[robot.axis.model.nominal]"),
    )
    assert "tau0 (changes from" in outlook(record, free="Jm,Ja,fm,fc,tau0")


@pytest.mark.soak
def test_what_fix_holds_is_distinguished(folder: Path, seed: int) -> None:
    """A file whose record did not distinguish viscous from Coulomb friction, as other programs may write it."""
    config = load(folder / "robot.toml", {})
    record = followed(folder, "record.csv", seed, SEVERAL_SPEEDS)
    request = Request(free=("Jm", "Ja", "fm", "fc"), start="values")
    report = prepare(config, config.axes[0], [record], [], request).run(Provenance.now())
    found = tomlkit.parse(as_toml(report))
    names, matrix = found["correlation"]["names"], found["correlation"]["matrix"]
    fm, fc = names.index("fm"), names.index("fc")
    matrix[fm][fc] = matrix[fc][fm] = -0.99
    found["standard_deviations"]["fm"] = 0.3 * found["values"]["fm"]
    (folder / "nominal.toml").write_text(tomlkit.dumps(found), encoding="utf-8")
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    own = commissioned(text, {"demo.axis1": Found("nominal.toml", None, ["kT", "fm"])})
    (folder / "own.toml").write_text(own, encoding="utf-8")

    words = " ".join(shown("check", "--config", "own.toml").split())
    advice = re.search(r"fm and fc cannot be distinguished .*`axiswatch (identify --fix fc)`", words)
    assert advice, words
    # Starting values are searched for elsewhere.
    shown(*advice[1].split(), "--start", "values", "--config", "own.toml", record, "-o", "again.toml")
    edit(folder / "own.toml", ("nominal.toml", "again.toml"))
    assert "cannot be distinguished" not in shown("check", "--config", "own.toml")
