"""An arm of two axes that hold each other's links, commissioned from one table: nobody says what follows what."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration import CalibrationOptions
from monitor_core.identification import LinkWeights
from service.commands import commission
from service.commands.command_line.exit_codes import NOT_TESTED
from service.commands.commissioning.axis import axis_identification
from service.commands.commissioning.axis.load_search import LinkLoad, LoadSearch
from service.config import NamedAxis, load
from service.config.written.commissioned import configured, corrected
from service.ingest.records.loaded_records import load as load_record
from tests.core.arm import AXES, Arm, ArmSamples, ArmTruth, R
from tests.end_to_end.processes import edit
from tests.service.command_line import axiswatch
from tests.shares import soaked

pytestmark = pytest.mark.usefixtures("without_pictures")

QUICK = CalibrationOptions(600.0, None, (0.3,), 1, copies=50_000, bank_copies=10_000)


class Cell(NamedTuple):
    """The arm after its commissioning."""

    arm: Arm
    folder: Path

    @property
    def config(self) -> Path:
        return self.folder / "commissioned" / "axiswatch.toml"


def write(path: Path, samples: ArmSamples, side: float = R) -> Path:
    """A table of joint torques and angles; ``side`` 1: of those of the motors."""
    columns = [samples.t_us * 1e-6]
    names = ["time"]
    for axis, name in enumerate(AXES):
        columns += [samples.u[:, axis] / side, samples.y[:, axis] * side]
        names += [f"{name}_torque", f"{name}_angle"]
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    return path


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Cell:
    folder = tmp_path_factory.mktemp("arm")
    arm = Arm(ArmTruth(), np.random.default_rng(seed))
    record = write(folder / "healthy.csv", arm.take(45.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(commission, "options_for", lambda _budget_s: QUICK)
        patch.setattr("os.cpu_count", lambda: 1)  # in this process, without pictures
        # Motions for what these records do not show are planned in tests/service/commands/identify/test_advice.py.
        patch.setattr(axis_identification, "motion_for", lambda *_: None)
        init = axiswatch("init", record, "-o", folder / "axis.toml")
        assert init.exit_code == 0, init.output
        # To look for it is most of the work, and tested elsewhere.
        edit(folder / "axis.toml", ("kT = 1 }", "kT = 1 }, friction_speed_scale = 0.01"))
        done = axiswatch(
            "commission",
            record,
            "--config",
            folder / "axis.toml",
            "--yes",
            "--output",
            folder / "commissioned",
        )
    assert done.exit_code == 0, done.output
    return Cell(arm, folder)


def test_each_axis_follows_the_links_that_it_holds(cell: Cell) -> None:
    shoulder, elbow = load(cell.config, {}).axes
    assert follows(shoulder) >= {"cos(shoulder)", "cos(shoulder + elbow)"}
    assert follows(elbow) >= {"cos(shoulder + elbow)"}
    for axis in (shoulder, elbow):
        assert {s.axis for s in axis.config.signal} == {"shoulder", "elbow"}
        assert "kT" in axis.config.model.monitor
        assert "tau0" not in axis.config.model.monitor
        assert "load" not in axis.config.model.monitor  # for its memory this record is too short
    report = (cell.config.parent / "report.html").read_text(encoding="utf-8")
    assert "The torque shows the weight of links at these angles" in report


def follows(axis: NamedAxis) -> set[str]:
    """What the torque offset of an axis follows, by its nominal values."""
    found = axis.config.model.nominal_file
    assert found is not None
    return {v.signal for v in found.schedule if v.parameter == "tau0"}


def test_a_weak_motor_is_named_and_the_healthy_arm_is_quiet(cell: Cell) -> None:
    healthy = write(cell.folder / "second.csv", cell.arm.take(40.0))
    faulty = write(cell.folder / "faulty.csv", cell.arm.take(40.0, {"shoulder kT": 0.75}))
    assert alarms(cell, healthy) == {}
    found = alarms(cell, faulty)
    assert set(found) == {"robot1.shoulder"}
    assert found["robot1.shoulder"] == [("kT", "down")]


def test_in_poses_that_no_record_has_nothing_is_tested(cell: Cell) -> None:
    """To the other side: the cosine of the shoulder is within its range."""
    taken = cell.arm.take(40.0)
    moved = write(cell.folder / "moved.csv", taken._replace(y=taken.y * [-1.0, 1.0]))
    done = axiswatch("replay", moved, "--config", cell.config)
    assert done.exit_code == NOT_TESTED, done.output
    assert "Not tested: robot1.shoulder: " in done.output
    assert "of the way of the axis is in poses of the robot that no record of the calibration has" in done.output


def alarms(cell: Cell, record: Path) -> dict[str, list[tuple[str, str]]]:
    done = axiswatch("replay", record, "--config", cell.config, "--json", "-")
    assert done.exit_code == 0, done.output
    axes = json.loads(done.stdout)["axes"]
    return {a["id"]: [(e["parameter"], e["direction"]) for e in a["alarms"]] for a in axes if a["alarms"]}


def load_of(text: str, axis_id: str, record: Path) -> LinkLoad:
    """What the load on an axis follows in a table, with the configuration of this text."""
    found = LoadSearch(text, axis_id, [str(record)], record.parent).links
    assert found is not None
    return found


AXIS = """
[[robot.axis]]
name = "{name}"
torque = {{ column = "{column}_torque" }}
angle = {{ column = "{column}_angle" }}
"""
MOTORS = """
[[robot]]
name = "arm"
[robot.defaults]
sample_interval_s = 0.005
time = { column = "time" }
model = { drive = "one-mass-weight", monitor = ["kT"], nominal = { kT = 1, r = 0.01 } }
"""


@pytest.mark.parametrize("names", soaked(["J1 J2", "1 2"], "1 2"))
def test_of_motors_the_gear_ratio_makes_the_angle_of_the_arm(names: str, cell: Cell, tmp_path: Path) -> None:
    """Axes that are only numbered get signals with a letter."""
    record = write(tmp_path / "motors.csv", cell.arm.take(60.0), 1.0)
    first, second = names.split()
    text = MOTORS + "".join(AXIS.format(name=n, column=c) for n, c in zip((first, second), AXES, strict=True))
    found = load_of(text, f"arm.{second}", record)
    signals = [name if name.startswith("J") else f"axis{name}" for name in (first, second)]
    assert f"cos({signals[0]} + {signals[1]})" in found.weights.terms
    changes = {c.key: c.value for c in found.changes}
    for signal, name in zip(signals, (first, second), strict=True):
        assert changes["signal", signal, "axis"] == name
    # The speeds and accelerations that belong to these angles are those of the arm, too.
    assert {c.key[1] for c in found.changes} == {name for name, key in ((c.key[1], c.key[2]) for c in found.changes)
                                                 if key == "factor" and changes["signal", name, key] == R}  # fmt: skip
    # Hundreds of radians are no angle of an arm: without the ratios the weight tells about what they are.
    without = load_of(text.replace(", r = 0.01", ", r = 1"), f"arm.{second}", record)
    ratios = [c.value for c in without.changes if c.key[2] == "factor"]
    assert len(ratios) >= 2
    assert ratios == pytest.approx([R] * len(ratios), rel=1 / 3)


def test_motors_whose_gear_ratio_nobody_gives_are_named(cell: Cell, tmp_path: Path) -> None:
    record = write(tmp_path / "motors.csv", cell.arm.take(60.0), 1.0)
    axes = "".join(AXIS.format(name=name, column=name) for name in AXES)
    text = MOTORS.replace("one-mass-weight", "one-mass").replace(", r = 0.01", "")

    def without_ratio(text: str) -> tuple[str, ...]:
        return LoadSearch(text, "arm.elbow", [str(record)], tmp_path).motors_without_ratio

    assert without_ratio(text + axes) == AXES
    # One mass has no gear, but the angle of its motor turns links.
    assert without_ratio(text.replace("kT = 1", "kT = 1, r = 0.01") + axes) == ()
    # Angles of the arm need none, nor do linear axes.
    assert without_ratio(text + axes.replace('_angle"', '_angle", factor = 0.01')) == ()
    renamed = record.read_text(encoding="utf-8").replace("shoulder_angle", "shoulder [mm]", 1)
    record.write_text(renamed, encoding="utf-8")
    assert without_ratio(text + axes.replace("shoulder_angle", "shoulder [mm]")) == ("elbow",)


ONE_MASS = """
[[robot]]
name = "arm"
[robot.defaults]
sample_interval_s = 0.01
time = { column = "t" }
model = { drive = "one-mass", monitor = ["kT"], nominal = { kT = 1 } }
"""


def arm_of(*names: str) -> str:
    """The configuration of an arm with these axes."""
    return ONE_MASS + "".join(
        f'[[robot.axis]]\nname = "{name}"\ntorque = {{ column = "u{k}" }}\nangle = {{ column = "y{k}" }}\n'
        for k, name in enumerate(names, 1)
    )


class Swing(NamedTuple):
    """Angles, speeds and accelerations of two axes (2, N), and their times."""

    t: Floats
    q: Floats
    w: Floats
    a: Floats

    @classmethod
    def drawn(cls, rng: np.random.Generator, seconds: float, *sizes: float) -> Swing:
        """Sums of five sines."""
        step = 0.01
        t = np.arange(0.0, seconds, step)
        f, phase = rng.uniform(0.1, 0.6, (2, 5)), rng.uniform(0, 2 * np.pi, (2, 5))
        sines = np.sin(2 * np.pi * f[..., None] * t + phase[..., None]).mean(axis=1)
        q = sines * np.array(sizes)[:, np.newaxis]
        w = np.gradient(q, step, axis=1)
        return cls(t, q, w, np.gradient(w, step, axis=1))

    def write(self, path: Path, u: Floats) -> None:
        """A table of the motion with these torques (2, N)."""
        table = np.column_stack([self.t, u[0], self.q[0], u[1], self.q[1]])
        np.savetxt(path, table, fmt="%.9g", delimiter=",", header="t,u1,y1,u2,y2", comments="")


SCARA = arm_of("inner", "2")


def test_the_acceleration_of_an_axis_without_weight(tmp_path: Path, seed: int) -> None:
    """The outer arm of a SCARA, whose coupling depends on its angle; the corrections give it as a signal, once."""
    rng = np.random.default_rng(seed)
    swing = Swing.drawn(rng, 120.0, 1.0, 1.0)
    _, q, w, a = swing
    coupling = 0.7 + 0.3 * np.cos(q[1])
    u = np.array([[1.0], [0.5]]) * (a + 0.5 * w) + np.tanh(w / 0.05) + coupling * a[::-1]
    u[0] -= coupling * a[1]  # the first feels nothing of the second
    record = tmp_path / "a.csv"
    swing.write(record, u + rng.normal(0, 0.1, q.shape))
    found = load_of(SCARA, "arm.2", record)
    assert found.weights.terms == ("inner-acceleration", "inner-acceleration * cos(axis2)")
    changes = {c.key: c.value for c in found.changes}
    name = ("signal", "inner-acceleration")
    assert changes == {
        (*name, "axis"): "inner",
        (*name, "acceleration"): True,
        ("signal", "axis2", "axis"): "2",
    }
    assert load_of(corrected(SCARA, "arm.2", found.changes), "arm.2", record) == found
    assert LoadSearch(SCARA, "arm.inner", [str(record)], tmp_path).links is None


def test_terms_that_explain_too_little_for_a_load_give_the_angles_of_the_poses(tmp_path: Path, seed: int) -> None:
    """A wrist whose weight is a sixth of its friction: in other programs it may be more."""
    rng = np.random.default_rng(seed)
    swing = Swing.drawn(rng, 120.0, 1.0, 1.0)
    _, q, w, a = swing
    u = np.array([[1.0], [0.5]]) * (a + 0.5 * w) + np.tanh(w / 0.05)
    u[1] += 0.18 * np.cos(q[0] + q[1])
    swing.write(tmp_path / "a.csv", u + rng.normal(0, 0.1, q.shape))
    search = LoadSearch(SCARA, "arm.2", [str(tmp_path / "a.csv")], tmp_path)
    assert search.links is None
    assert search.terms is not None
    assert search.terms.weights.terms == ("cos(inner + axis2)",)
    assert {change.key: change.value for change in search.terms.poses} == {
        ("signal", "inner", "axis"): "inner",
        ("signal", "axis2", "axis"): "2",
    }


GUN = """
[[robot]]
name = "arm"
[[robot.axis]]
name = "gun"
sample_interval_s = 0.01
time = { column = "t" }
torque = { column = "u1" }
angle = { column = "y1" }
signal = [{ name = "GUN", column = "y2" }]
model = { drive = "one-mass", monitor = ["kT"], nominal = { kT = 1 } }
"""


@pytest.mark.parametrize(("pressing", "key"), [(1, "below"), (0, "above")])
def test_a_gate_leaves_out_what_presses(pressing: int, key: str, tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    t, q, w, a = Swing.drawn(rng, 180.0, 2.0, 1.0)
    presses = q[0] < -0.2
    u = 0.5 * a[0] + 0.5 * w[0] + np.tanh(w[0] / 0.05) + np.where(presses, 12 * (q[0] + 0.2), 0)
    q[1] = np.where(presses, pressing, 1 - pressing)
    Swing(t, q, w, a).write(tmp_path / "a.csv", np.array([u, u]) + rng.normal(0, 0.1, q.shape))
    records = [str(tmp_path / "a.csv")]
    found = LoadSearch(GUN, "arm.gun", records, tmp_path).pressing
    assert found is not None
    assert found.links is None
    force, (gate, settling) = found.force, found.changes
    assert gate.change == f"gate.GUN.{key} = 0.5"
    assert settling.change == "gate.GUN.settle_s = 0.1"
    assert gate.reason.startswith(f"while GUN is {pressing}, a force acts that no motion of the axis explains")
    text = corrected(GUN, "arm.gun", [gate, settling])
    (axis,) = configured(text, "arm.gun", tmp_path)[0].axes
    record = load_record(records[0], configured(text, "arm.gun", tmp_path)[0], "arm.gun").record
    assert record.gate is not None
    recently = np.convolve(presses, np.ones(11))[: t.size] > 0  # it has pressed within 0.1 s
    assert record.gate.tolist() == (~recently).tolist()
    assert axis.config.gate[0].signal == "GUN"
    # What it leaves out is no load any more, and is not looked for again.
    search = LoadSearch(text, "arm.gun", records, tmp_path)
    assert search.pressing is None
    assert search.links is None
    assert force.explained > 0.85


GRINDER = arm_of("base", "lift").replace(
    "[[robot.axis]]",
    'signal = [{ name = "SPINDLE", column = "s" }, { name = "CONTACT", column = "c" }]\n[[robot.axis]]',
    1,
)


def grinding(rng: np.random.Generator, path: Path, carried: float = 0.0) -> None:
    """A record of an arm whose tool presses with a varying force for two fifths of the time, "c"; its spindle is on
    longer, "s".  ``carried``: it bears this share of its own weight instead, from standstill to standstill."""
    swing = Swing.drawn(rng, 240.0, 1.5, 1.2)
    t, q, w, a = swing
    contact, spindle = (np.sin(2 * np.pi * t / 13.7) > limit for limit in (0.3, -0.3))
    if carried:
        turns = np.flatnonzero(np.diff(np.sign(w[1])))
        contact = contact[turns[np.clip(np.searchsorted(turns, np.arange(t.size)) - 1, 0, None)]]
    slow = np.interp(t, np.arange(0, 241.0), rng.uniform(2, 25, 241))
    u = np.array([2 * a[0], 4 * a[1] + 40 * np.cos(q[1])])
    u += np.array([0 * t, carried * u[1]] if carried else [0.2 * slow, slow * np.sin(q[1] - 0.4)]) * contact
    u += 0.8 * w + np.tanh(w / 0.05) + rng.normal(0, 0.1, q.shape)
    table = np.column_stack([t, u[0], q[0], u[1], q[1], spindle, contact])
    np.savetxt(path, table, fmt="%.9g", delimiter=",", header="t,u1,y1,u2,y2,s,c", comments="")


def test_what_presses_is_left_out_of_an_arm_that_holds_its_links(tmp_path: Path, seed: int) -> None:
    """The weight hides that one mass explains the rest; and the spindle, which is on longer, is not taken for it."""
    grinding(np.random.default_rng(seed), tmp_path / "a.csv")
    records = [str(tmp_path / "a.csv")]
    found = LoadSearch(GRINDER, "arm.lift", records, tmp_path).pressing
    assert found is not None
    assert found.links is not None
    assert (found.force.signal, found.force.free, found.force.pressing) == ("CONTACT", 0.0, 1.0)
    assert [change.change for change in found.changes] == ["gate.CONTACT.below = 0.5", "gate.CONTACT.settle_s = 0.1"]
    assert "without that part one mass with the load of links explains" in found.changes[0].reason
    assert found.links.weights.terms == ("cos(lift)",)
    assert [change.change for change in found.links.changes] == ['signal.lift.axis = "lift"']
    assert found.force.explained == found.links.weights.explained > 0.9
    explained_as_well = LoadSearch(GRINDER, "arm.lift", records, tmp_path)
    explained_as_well.links = LinkLoad(LinkWeights(("CONTACT * cos(lift)",), 0.99, 0.5), ())
    assert explained_as_well.pressing is None


def test_what_an_arm_carries_is_not_left_out(tmp_path: Path, seed: int) -> None:
    grinding(np.random.default_rng(seed), tmp_path / "a.csv", carried=0.3)
    search = LoadSearch(GRINDER, "arm.lift", [str(tmp_path / "a.csv")], tmp_path)
    search.links = None  # also if no load explained it at all times
    assert search.pressing is None


BASE = arm_of("base", "lift")


def test_the_inertia_of_a_base_follows_the_pose_of_the_arm(tmp_path: Path, seed: int) -> None:
    """A base that turns an arm which another axis lifts: its signals are the motion of both."""
    rng = np.random.default_rng(seed)
    swing = Swing.drawn(rng, 180.0, 2.0, 1.5)
    _, q, w, a = swing
    arm = 4 * np.cos(q[1]) ** 2
    base = (2 + arm) * a[0] - 4 * np.sin(2 * q[1]) * w[1] * w[0]
    lift = 4 * a[1] + 2 * np.sin(2 * q[1]) * w[0] ** 2 + 40 * np.cos(q[1])
    u = np.array([base, lift]) + 0.8 * w + np.tanh(w / 0.05) + rng.normal(0, 0.1, q.shape)
    swing.write(tmp_path / "a.csv", u)
    found = load_of(BASE, "arm.base", tmp_path / "a.csv")
    rate = "base-acceleration * cos(lift + lift) - 2 * base-speed * lift-speed * sin(lift + lift)"
    assert found.weights.terms == (rate,)
    assert found.weights.explains_much_more
    assert {c.key[1:]: c.value for c in found.changes} == {
        ("base-acceleration", "axis"): "base",
        ("base-acceleration", "acceleration"): True,
        ("base-speed", "axis"): "base",
        ("base-speed", "speed"): True,
        ("lift", "axis"): "lift",
        ("lift-speed", "axis"): "lift",
        ("lift-speed", "speed"): True,
    }
    lifting = load_of(BASE, "arm.lift", tmp_path / "a.csv")
    assert set(lifting.weights.terms) == {"cos(lift)", "square(base-speed) * sin(lift + lift)"}


def test_an_angle_that_may_count_is_a_signal_without_a_term(tmp_path: Path, seed: int) -> None:
    """In the records the elbow moves as the lift does, so the inertia of the base may follow either."""
    rng = np.random.default_rng(seed)
    t, q, w, a = Swing.drawn(rng, 180.0, 2.0, 4.0)
    u = (4 + 3 * np.cos(q[1])) * a[0] - 3 * np.sin(q[1]) * w[1] * w[0] + 0.8 * w[0] + np.tanh(w[0] / 0.05)
    table = np.column_stack([t, u + rng.normal(0, 0.1, t.size), q[0], a[1], q[1], a[1], q[1]])
    names = "t,u1,y1,u2,y2,u3,y3"
    np.savetxt(tmp_path / "a.csv", table, fmt="%.9g", delimiter=",", header=names, comments="")
    found = load_of(arm_of("base", "lift", "elbow"), "arm.base", tmp_path / "a.csv")
    used = {name for term in found.weights.terms for name in ("lift", "elbow") if f"{name}-speed" in term}
    reasons = {c.value: c.reason for c in found.changes if c.key[1] in ("lift", "elbow")}
    assert reasons.keys() == {"lift", "elbow"}
    assert {axis for axis, reason in reasons.items() if "may follow" not in reason} == used
    assert len(used) == 1


POSITIONER = f"""{ONE_MASS}signal = [{{ name = "payload", column = "load" }}]
[[robot.axis]]
name = "tilt"
torque = {{ column = "tilt_u" }}
angle = {{ column = "tilt_y" }}
[[robot.axis]]
name = "table"
torque = {{ column = "table_u" }}
angle = {{ column = "table_y", factor = 0.0174532925, wrap_period = 360 }}
[[robot.axis]]
name = "hoist"
torque = {{ column = "hoist_u" }}
speed = {{ column = "hoist_w" }}
"""


@pytest.mark.parametrize(
    ("axis", "terms"),
    [
        ("tilt", {"payload * cos(tilt)"}),
        ("table", {"sin(tilt - table)", "sin(tilt + table)"}),
        ("hoist", {"payload"}),
    ],
)
def test_a_load_and_a_turntable_that_starts_again(axis: str, terms: set[str], tmp_path: Path, seed: int) -> None:
    """The workpiece on a turntable weighs by the tilt; a hoist has no angle at all."""
    rng, step = np.random.default_rng(seed), 0.01
    t = np.arange(0.0, 120.0, step)
    f, phase = rng.uniform(0.1, 0.5, (3, 5)), rng.uniform(0, 2 * np.pi, (3, 5))
    tilt, turn, lift = (
        a * np.sin(2 * np.pi * np.outer(t, f[k]) + phase[k]).mean(axis=1) for k, a in enumerate((2, 20, 9))
    )
    load = np.repeat(rng.permutation([0.0, 1.0, 0.5, 1.0, 0.2, 0.8]), t.size // 6)
    weights = 9 * load * np.cos(tilt), 9 * np.sin(tilt) * np.cos(turn), 5 + 9 * load
    columns = [t]
    for y, weight in zip((tilt, turn, lift), weights, strict=True):
        w = np.gradient(y, step)
        u = np.gradient(w, step) + 0.5 * w + np.tanh(w / 0.05) + weight
        columns += [u + rng.normal(0, 0.1, t.size), y]
    columns[4] = np.degrees(turn) % 360
    columns[6] = np.gradient(lift, step)
    names = "t,tilt_u,tilt_y,table_u,table_y,hoist_u,hoist_w,load"
    table = np.column_stack([*columns, load])
    np.savetxt(tmp_path / "a.csv", table, fmt="%.9g", delimiter=",", header=names, comments="")
    assert set(load_of(POSITIONER, f"arm.{axis}", tmp_path / "a.csv").weights.terms) == terms


GANTRY = arm_of("across", "lift").replace(
    "[[robot.axis]]", 'signal = [{ name = "DO3", column = "grip" }]\n[[robot.axis]]', 1
)


def gripping(rng: np.random.Generator, path: Path) -> None:
    """A table of a gantry whose lift carries something half of the time."""
    swing = Swing.drawn(rng, 240.0, 60.0, 30.0)
    w = swing.w * np.sin(np.pi * swing.t / 4) ** 2  # a rest at multiples of 4 s, where the gripper acts
    q, a = np.cumsum(w, axis=1) * 0.01, np.gradient(w, 0.01, axis=1)
    grip = np.repeat(rng.permutation(np.arange(60) % 2), 400).astype(float)
    u = np.array([0.1 * a[0], (0.02 + 0.01 * grip) * a[1] + 2 + 1.5 * grip])
    u += 0.01 * w + 0.3 * np.tanh(w / 0.2) + rng.normal(0, 0.03, q.shape)
    columns = np.column_stack([swing.t, u[0], q[0], u[1], q[1], grip])
    np.savetxt(path, columns, fmt="%.9g", delimiter=",", header="t,u1,y1,u2,y2,grip", comments="")


def test_what_a_gantry_grips_is_weight_and_inertia(tmp_path: Path, seed: int) -> None:
    """The angle of the motor of a linear axis is none of an arm."""
    gripping(np.random.default_rng(seed), tmp_path / "a.csv")
    found = load_of(GANTRY, "arm.lift", tmp_path / "a.csv")
    assert set(found.weights.terms) == {"DO3", "DO3 * lift-acceleration"}
    assert found.weights.explains_much_more
    assert {c.key[1:]: c.value for c in found.changes} == {
        ("lift-acceleration", "axis"): "lift",
        ("lift-acceleration", "acceleration"): True,
    }
    assert LoadSearch(GANTRY, "arm.across", [str(tmp_path / "a.csv")], tmp_path).links is None


@pytest.mark.parametrize(("name", "column"), [("temperature", "grip"), ("DO3", "Temp_Gear"), ("Temp_Gear", "grip")])
def test_a_temperature_is_no_load(name: str, column: str, tmp_path: Path, seed: int) -> None:
    """Friction may follow it, whatever the torque looks like: it would take the place of a warm-up."""
    record = tmp_path / "a.csv"
    gripping(np.random.default_rng(seed), record)
    record.write_text(record.read_text(encoding="utf-8").replace("grip", column, 1), encoding="utf-8")
    text = GANTRY.replace("DO3", name).replace("grip", column)
    search = LoadSearch(text, "arm.lift", [str(record)], tmp_path)
    assert search.links is None
    assert search.pressing is None
