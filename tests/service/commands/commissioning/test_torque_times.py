"""A torque that changes between the samples is taken in the middle, as all axes of a robot show it together."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from monitor_core.identification import TorqueTime
from service.commands.commissioning.signals.torque_times import torque_time_doubts, torque_times
from service.commands.main import app
from service.config import Config
from tests.core.sampled_torques import FM, record_of

H_S = 0.012


def axis(name: str, late: float = 0.0) -> str:
    model = "model = { drive = 'one-mass', monitor = ['kT', 'fc', 'fm'], nominal = { kT = 1 } }\n"
    return (
        f"[[robot.axis]]\nname = '{name}'\nsample_interval_s = {H_S}\ntime = {{ column = 't' }}\n"
        f"angle = {{ column = 'y' }}\ntorque = {{ column = 'u', late_samples = {late} }}\n{model}"
    )


def robots(**late: float) -> Config:
    both = {"sample_interval_s": H_S, "angle": {"column": "y"}, "model": {"drive": "one-mass", "monitor": ["kT"]}}
    torques = {name: {"column": "u", "late_samples": late.get(name, 0.0)} for name in "ab"}
    axes = [{"name": name, "torque": torque, **both} for name, torque in torques.items()]
    return Config.model_validate({"robot": [{"name": name, "axis": axes} for name in ("r", "s")]})


def test_an_axis_that_does_not_show_it_follows_its_robot_but_no_other() -> None:
    found = torque_times(robots(), {"r.a": TorqueTime(0.5, 0.1), "r.b": None, "s.a": TorqueTime(0.0, 0.1), "s.b": None})
    assert {name: str(change) for name, change in found.items()} == dict.fromkeys(
        ("r.a", "r.b"),
        "torque.late_samples = 0.5: the torque changes between one sample and the next, 0.012 s later: the mean of both"
        " acts",
    )


def test_what_is_right_stays_and_what_is_configured_wrongly_is_named() -> None:
    shown = {"r.a": TorqueTime(0.45, 0.1), "r.b": TorqueTime(0.55, 0.1)}
    (change,) = torque_times(robots(b=0.5), shown).values()
    assert change.value == 0.5
    assert torque_times(robots(a=0.5, b=0.5), shown) == {}
    found = torque_times(robots(a=0.5, b=2.0), {"r.a": TorqueTime(0.0, 0.1), "r.b": TorqueTime(1.6, 0.1)})
    assert [(c.value, c.reason) for c in found.values()] == [
        (0.0, "the torque of a sample acts until the next one, and does not come late"),
        (1.5, "the torque comes 0.018 s later than the motion that it has caused, as a filtered one does"),
    ]
    assert torque_times(robots(), {"r.a": TorqueTime(14.0, 0.1)})["r.a"].value == 10


@pytest.mark.parametrize(
    ("late", "shown", "right"),
    [
        (0.0, TorqueTime(0.3, 0.2), "0.5"),  # at 12 ms it needs no evidence
        (0.0, TorqueTime(0.0, 0.1), None),
        (0.0, None, None),
        (0.0, TorqueTime(14.0, 0.1), "10"),
        (0.5, TorqueTime(1.5, 0.1), None),  # the robot knows better
    ],
)
def test_an_axis_alone_is_doubted_where_nothing_is_configured(
    late: float, shown: TorqueTime | None, right: str | None
) -> None:
    found = list(torque_time_doubts(robots(a=late).axes[0].config, shown))
    named = [words.partition("Set late_samples = ")[2].partition(" ")[0] for words in found]
    assert named == ([] if right is None else [right])


def test_identify_names_the_cure_and_the_cure_gives_the_friction(tmp_path: Path, seed: int) -> None:
    """Taken from the sample on, the torque at the sample makes viscous friction too large."""
    record = record_of("at the sample", H_S, np.random.default_rng(seed))
    table = np.column_stack([record.t, record.u, record.y])
    np.savetxt(tmp_path / "a.csv", table, "%.9g", ",", header="t,u,y", comments="")
    found: dict[float, float] = {}
    for late in (0.0, 0.5):
        (tmp_path / "axis.toml").write_text(f"[[robot]]\nname = 'r'\n{axis('a', late)}", encoding="utf-8")
        words = ["identify", str(tmp_path / "a.csv"), "--config", str(tmp_path / "axis.toml")]
        done = CliRunner().invoke(app, [*words, "--output", str(tmp_path / f"{late}.toml")])
        assert done.exit_code == 0
        assert ("Set late_samples = 0.5 in [robot.axis.torque]" in " ".join(done.output.split())) is (late == 0)
        text = (tmp_path / f"{late}.toml").read_text(encoding="utf-8")
        (value,) = re.findall(r"^fm = (\S+)  #", text, re.MULTILINE)
        found[late] = float(value)
    assert found[0.5] == pytest.approx(FM, rel=0.03)
    assert found[0.0] > 1.08 * FM


def test_commission_proposes_it_for_each_axis_of_the_robot_with_its_other_corrections(
    tmp_path: Path, seed: int
) -> None:
    """Another interval is corrected first; one that is right stays; an axis whose torque is stuck is refused."""
    record = record_of("at the sample", H_S, np.random.default_rng(seed))
    table = np.column_stack([record.t, record.u, record.y, np.full(record.t.size, 0.3)])
    np.savetxt(tmp_path / "a.csv", table, "%.9g", ",", header="t,u,y,stuck", comments="")
    wrong = (axis("a") + axis("c").replace("'u'", "'stuck'")).replace(str(H_S), "0.006")
    axes = wrong + axis("b", 0.5)
    (tmp_path / "axis.toml").write_text(f"[[robot]]\nname = 'r'\n{axes}", encoding="utf-8")
    words = ["commission", str(tmp_path / "a.csv"), "--config", str(tmp_path / "axis.toml"), "--budget", "1h"]
    done = CliRunner().invoke(app, [*words, "--output", str(tmp_path / "out")])
    assert done.exit_code == 2
    shown = [line.partition(" -> ") for line in done.output.splitlines() if " -> " in line]
    proposed = [(words.partition(":")[0], change) for words, _, change in shown]
    late = ("r.a", "torque.late_samples = 0.5")
    assert proposed == [*((f"r.{name}", "sample_interval_s = 0.012") for name in "ac"), late]
    assert "one sample and the next, 0.012 s later" in shown[-1][0]
