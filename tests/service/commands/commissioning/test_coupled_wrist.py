"""A wrist whose last motor also moves with the axis before it: its friction follows the motor, its weight the arm."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration import CalibrationOptions
from monitor_core.identification import ArmLoad, ArmSignals, Effect, FitQuality, Record, arm_load, motor_coupling
from service.commands.commissioning.axis import coupling_search, load_search
from service.commands.commissioning.axis.axis_job import AxisJob
from service.commands.commissioning.axis.coupling_search import with_coupling
from service.commands.commissioning.axis.identification_retries import retry
from service.commands.commissioning.axis.load_search import LoadSearch, LoadSearches
from service.commands.commissioning.axis.missing_motion import SuggestedMotion, within_arm
from service.commands.commissioning.axis.planned_motion import MotionRequest
from service.config import load
from service.reports.commissioning_report import Outcome
from service.reports.formats import Provenance
from tests.service.command_line import axiswatch

pytestmark = pytest.mark.usefixtures("without_pictures")

FACTOR = -0.6
TRUE = {"J": 0.02, "fm": 0.3, "fc": 0.5}
WEIGHT = 0.8
"""Torque of the weight [N m]"""
COUNT, H_S = 5000, 0.005
COUPLING_KEY = "coupling"
COUPLING = f"coupling = {{ bend = {FACTOR} }}"
ROBOT = """\
[[robot]]
name = "cell"
[robot.defaults]
sample_interval_s = 0.005
time = { column = "t" }
[robot.defaults.model]
drive = "one-mass"
monitor = ["fm", "fc"]
nominal = { kT = 1, J = 0.05, fm = 0.5, fc = 0.2, tau0 = 0 }
friction_speed_scale = 0.05
[[robot.axis]]
name = "bend"
torque = { column = "bend_torque" }
angle = { column = "bend" }
[[robot.axis]]
name = "turn"
torque = { column = "turn_torque" }
angle = { column = "turn" }
COUPLING
"""


class Motion(NamedTuple):
    """An angle (N,) and its derivatives by time."""

    angle: Floats
    speed: Floats
    acceleration: Floats


def motion(t: Floats, seed: int) -> Motion:
    """A sum of sines without a common period."""
    rng = np.random.default_rng(seed)
    w: Floats = 2 * np.pi * rng.uniform(0.08, 0.9, 9)[:, np.newaxis]
    size, phase = rng.uniform(0.15, 0.35, (9, 1)), rng.uniform(0, 2 * np.pi, (9, 1))
    x = w * t + phase
    return Motion(
        np.sum(size * np.sin(x), axis=0),
        np.sum(size * w * np.cos(x), axis=0),
        np.sum(-size * w**2 * np.sin(x), axis=0),
    )


def written(folder: Path, seed: int, weight: float = 0.0, factor: float = FACTOR) -> Path:
    """A table with the angles of the arm."""
    rng = np.random.default_rng(seed)
    t: Floats = H_S * np.arange(COUNT, dtype=float)
    angles = np.stack([motion(t, 2 * seed + axis).angle for axis in range(2)])
    # A torque is held from one sample to the next.
    bend, turn = (motion(t + H_S / 2, 2 * seed + axis) for axis in range(2))
    speed = turn.speed + factor * bend.speed
    torque = TRUE["J"] * (turn.acceleration + factor * bend.acceleration) + TRUE["fm"] * speed
    torque += TRUE["fc"] * np.tanh(speed / 0.05) + weight * np.cos(turn.angle) + rng.normal(scale=0.01, size=COUNT)
    bent, turned = angles + rng.normal(scale=2e-5, size=angles.shape)
    table = np.column_stack([t, 0.0 * t, bent, torque, turned])
    path = folder / "wrist.csv"
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header="t,bend_torque,bend,turn_torque,turn", comments="")
    return path


def robot(folder: Path, coupling: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(ROBOT.replace("COUPLING", coupling), encoding="utf-8")
    return path


def identified(folder: Path, record: Path, coupling: str) -> dict[str, float]:
    """The values that are found, over the true ones."""
    config = robot(folder, coupling)
    words = (
        "--start",
        "values",
        "--config",
        config,
        "--axis",
        "turn",
        "--json",
        "-",
        "-o",
        folder / "nominal.toml",
        "--force",
    )
    done = axiswatch("identify", record, *words)
    assert done.exit_code == 0, done.output
    rows = {row["name"]: row["value"] for row in json.loads(done.stdout)["parameters"]}
    return {name: rows[name] / value for name, value in TRUE.items()}


def test_the_friction_is_that_of_the_motor(tmp_path: Path, seed: int) -> None:
    record = written(tmp_path, seed)
    right, wrong = identified(tmp_path, record, COUPLING), identified(tmp_path, record, "")
    print(right, wrong)
    assert right == pytest.approx(dict.fromkeys(TRUE, 1.0), abs=0.02)
    assert max(abs(wrong["fm"] - 1), abs(wrong["fc"] - 1)) > 0.2


@pytest.mark.parametrize(
    ("found_with", "used_with", "words"),
    [
        (COUPLING, COUPLING, "no problems"),
        (COUPLING, "", "found with a coupling by -0.6, but this axis has none: give it, or identify the axis again"),
        (COUPLING, "coupling = { bend = -0.5 }", "were found with -0.6: identify the axis again, or remove"),
        ("", COUPLING, "were found without it: identify the axis again, or remove"),
    ],
)
def test_nominal_values_of_another_coupling_are_refused(
    found_with: str, used_with: str, words: str, tmp_path: Path, seed: int
) -> None:
    identified(tmp_path, written(tmp_path, seed), found_with)
    config = robot(tmp_path, used_with)
    text = config.read_text().replace("nominal = { kT = 1, J = 0.05, fm = 0.5, fc = 0.2, tau0 = 0 }", "")
    config.write_text(text.replace("friction_speed_scale = 0.05", "") + 'model = { nominal_file = "nominal.toml" }\n')
    checked = axiswatch("check", "--config", config)
    assert checked.exit_code == (0 if found_with == used_with else 2)
    assert words in " ".join(checked.output.split())


def test_the_weight_follows_the_arm(tmp_path: Path, seed: int) -> None:
    """Also where the axis alone bears it, as the angle in a drive with a weight would be that of the motor."""
    record = written(tmp_path, seed, WEIGHT)
    text = robot(tmp_path, COUPLING).read_text(encoding="utf-8")
    found = LoadSearch(text, "cell.turn", [str(record)], tmp_path).links
    assert found is not None
    assert found.weights.signals == {"turn"}
    assert {change.key: change.value for change in found.changes}["signal", "turn", "axis"] == "turn"
    assert found.weights.explained > 0.95
    robot(tmp_path, "").write_text(text.replace(COUPLING, ""), encoding="utf-8")
    alone = LoadSearch(text.replace(COUPLING, ""), "cell.turn", [str(record)], tmp_path).links
    assert alone is None or alone.weights.explained < found.weights.explained - 0.05


def test_a_planned_motion_stays_within_that_of_the_arm(tmp_path: Path, seed: int) -> None:
    """The motor moves farther, and faster, as the other axis moves it, too."""
    record = written(tmp_path, seed)
    text = robot(tmp_path, COUPLING).read_text(encoding="utf-8")
    job = AxisJob(text, "cell.turn", (str(record),), tmp_path, CalibrationOptions(600.0), Provenance.now(), True)
    far = SuggestedMotion(("fm",), MotionRequest(torque=2.0, speed=99.0, angle=99.0))
    request = within_arm(far, job).request
    turn = motion(H_S * np.arange(COUNT, dtype=float), 2 * seed + 1)
    assert request.torque == 2.0
    assert request.angle == pytest.approx(np.ptp(turn.angle) / 2, rel=0.01)
    assert request.speed == pytest.approx(np.quantile(abs(turn.speed), 0.99), rel=0.02)


@pytest.mark.parametrize(("coupling", "drive"), [("", "one-mass-weight"), (COUPLING, "three-mass")])
def test_no_drive_with_a_weight_is_tried(coupling: str, drive: str, tmp_path: Path) -> None:
    verdict = SimpleNamespace(missing=(Effect.POSE,), quality=FitQuality.POOR)
    report: Any = SimpleNamespace(rejection="no fit", result=SimpleNamespace(watched=(), verdict=verdict))
    path = robot(tmp_path, coupling)
    axis = next(axis for axis in load(path, {}).axes if axis.id == "cell.turn")
    nothing: Any = SimpleNamespace(links=None, pressing=None)
    again = retry(report, path.read_text(encoding="utf-8"), axis, (), nothing, lambda: None)
    assert again is not None
    assert [change.value for change in again.changes if change.key == ("model", "drive")] == [drive]


# --- Commissioning finds the factor -----------------------------------------------------------------------------------

BEFORE = Outcome("cell.turn", notes=("before",))


def job(folder: Path, record: Path, coupling: str = "", yes: bool = True) -> AxisJob:
    """To commission the last axis."""
    text = robot(folder, coupling).read_text(encoding="utf-8")
    return AxisJob(text, "cell.turn", (str(record),), folder, CalibrationOptions(600.0), Provenance.now(), yes)


def coupled(task: AxisJob) -> tuple[AxisJob, Outcome]:
    return with_coupling(task, BEFORE, searches(task), lambda *_: None)


def searches(task: AxisJob) -> LoadSearches:
    return LoadSearches(task.axis_id, task.records, task.folder)


def coupling_in(text: str, folder: Path) -> dict[str, float]:
    path = folder / "found.toml"
    path.write_text(text, encoding="utf-8")
    return next(axis.config.coupling for axis in load(path, {}).axes if axis.id == "cell.turn")


def test_the_coupling_is_set_with_its_evidence(tmp_path: Path, seed: int) -> None:
    found, outcome = coupled(job(tmp_path, written(tmp_path, seed)))
    assert coupling_in(found.text, tmp_path) == pytest.approx({"bend": FACTOR}, rel=0.1)
    assert outcome.notes == BEFORE.notes
    (change,) = outcome.corrections
    assert change.key == ("coupling", "bend")
    assert change.value == float(f"{change.value:.3g}")
    assert "by its friction the motor also moves with bend, by a factor of -0." in change.reason
    assert "% of the squared errors, with values from the other half of the records" in change.reason


def test_without_consent_it_is_only_proposed(tmp_path: Path, seed: int) -> None:
    task = job(tmp_path, written(tmp_path, seed), yes=False)
    found, outcome = coupled(task)
    assert found == task
    assert not outcome.corrections
    assert "By its friction the motor also moves with bend" in outcome.notes[-1]
    assert "--yes applies coupling = { bend = -0." in outcome.notes[-1]


def test_where_the_motor_does_not_move_with_another_axis_nothing_is_set(tmp_path: Path, seed: int) -> None:
    task = job(tmp_path, written(tmp_path, seed, factor=0.0))
    assert coupled(task) == (task, BEFORE)


@pytest.mark.parametrize("likely", [True, False])
def test_a_load_that_shows_with_the_likeliest_factor_only(
    likely: bool, tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a large factor: without the load the friction does not show it, and without it no load is found."""

    class Hidden(LoadSearches):
        def search(self, text: str) -> Any:
            found = super().search(text)
            return found if COUPLING_KEY in text else SimpleNamespace(links=None)

    def shown(records: Sequence[Record], others: Sequence[str], terms: Sequence[str], known: Sequence[str]) -> Any:
        return motor_coupling(records, others, terms, known) if terms or known else None

    monkeypatch.setattr(coupling_search, "motor_coupling", shown)
    if not likely:
        monkeypatch.setattr(coupling_search, "likely_coupling", lambda *_: None)
    task = job(tmp_path, written(tmp_path, seed, WEIGHT))
    found, outcome = with_coupling(task, BEFORE, Hidden(task.axis_id, task.records, task.folder), lambda *_: None)
    if likely:
        assert coupling_in(found.text, tmp_path) == pytest.approx({"bend": FACTOR}, rel=0.1)
    else:
        assert (found, outcome) == (task, BEFORE)


def test_the_load_is_searched_once_for_one_configuration(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The identification that follows takes the search of the coupling, however its configuration is written."""
    calls = list[ArmSignals]()

    def counted(records: Sequence[Record], signals: ArmSignals) -> ArmLoad | None:
        calls.append(signals)
        return arm_load(records, signals)

    monkeypatch.setattr(load_search, "arm_load", counted)
    task = job(tmp_path, written(tmp_path, seed, WEIGHT, factor=0.0))
    loads = searches(task)
    assert with_coupling(task, BEFORE, loads, lambda *_: None) == (task, BEFORE)
    assert len(calls) == 1
    found = loads.search(f"# the same\n{task.text}").links
    assert len(calls) == 1
    assert found == LoadSearch(task.text, task.axis_id, task.records, task.folder).links
    other = task.text.replace('name = "turn"', f'name = "turn"\n{COUPLING}')
    assert loads.search(other) is not loads.search(task.text)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (COUPLING, ""),
        ("coupling = { bend = 0.3 }", "with the factor 0.3 that is given. The coupling is kept as it is given"),
    ],
)
def test_a_given_coupling_is_kept_and_doubted_where_the_records_contradict_it(
    given: str, words: str, tmp_path: Path, seed: int
) -> None:
    task = job(tmp_path, written(tmp_path, seed), given)
    found, outcome = coupled(task)
    assert found == task
    assert not outcome.corrections
    notes = outcome.notes[len(BEFORE.notes) :]
    assert [words in note and "coupling = { bend = -0." in note for note in notes] == ([True] if words else [])


def test_a_drive_with_a_weight_stays_without_coupling(tmp_path: Path, seed: int) -> None:
    task = job(tmp_path, written(tmp_path, seed))
    task = task._replace(text=task.text.replace('drive = "one-mass"', 'drive = "one-mass-weight"'))
    assert coupled(task) == (task, BEFORE)
