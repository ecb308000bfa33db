"""Units, ratios and broken signals of axes of several kinds: named, and put right or what settles it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from monitor_core.arrays import Floats
from service.commands.commissioning.signals.signal_proposals import Review, review
from service.config.written.corrections import Correction
from tests.service.commands.moving_axes import RATIO, H, axis_text, moves
from tests.shares import soaked

ROBOT = "[[robot]]\nname = 'cell'\n"
DEGREES, TURN = math.pi / 180, 2 * math.pi
Column = Callable[[Floats], Floats]
Columns = Mapping[str, Column]
"""Changes of the torque, "u", and of the motion, "y"; both may be absent"""
Look = Callable[..., Review]
AS_THEY_ARE: Columns = {}
IN_DEGREES: Columns = {"y": lambda y: y / DEGREES}


def counts(power: int) -> Column:
    return lambda y: np.rint(y * 2**power / TURN)


def looked_at(
    folder: Path,
    seed: int,
    drive: str,
    output: str,
    known: bool = True,
    columns: Columns = AS_THEY_ARE,
    names: str = "t,u,y",
    lacking: Collection[str] = (),
    **changed: float,
) -> Review:
    """What is found about a healthy axis whose columns were changed so, or whose nominal values."""
    m = moves(drive, seed)
    motion = m.angle if output == "angle" else m.speed
    rows = [columns.get("t", np.copy)(m.t), columns.get("u", np.copy)(m.torque), columns.get("y", np.copy)(motion)]
    path = folder / "record.csv"
    np.savetxt(path, np.column_stack(rows), "%.12g", ",", header=names, comments="")
    text = ROBOT + axis_text(drive, output, known, lacking, **changed)
    for name, new in zip("uy", names.split(",")[1:], strict=True):
        text = text.replace(f'column = "{name}"', f'column = "{new}"')
    return review(text, "cell.a1", [str(path)], folder)


@pytest.fixture
def look(tmp_path: Path, seed: int) -> Look:
    return partial(looked_at, tmp_path, seed)


def is_change(found: Correction, key: tuple[str, ...], value: float) -> bool:
    return found.key == key and math.isclose(float(found.value), value, rel_tol=1e-6)


KINDS = [("one-mass", "angle"), ("one-mass", "speed"), ("one-mass-weight", "angle")]
KNOWN: list[tuple[str, Columns, tuple[str, ...], float, str]] = [
    ("per mille", {"u": lambda u: np.rint(1000 * u / 2.4)}, ("torque", "factor"), 2.4e-3, "per mille of a rated"),
    ("N mm", {"u": lambda u: 1e3 * u}, ("torque", "factor"), 1e-3, "in N mm"),
    ("sign", {"u": lambda u: -u}, ("torque", "factor"), -1.0, "wrong sign"),
    ("degrees", IN_DEGREES, ("motion", "factor"), DEGREES, "in degrees"),
    ("counts", {"y": counts(12)}, ("motion", "factor"), TURN / 2**12, "2^12 = 4096"),
    ("fine counts", {"y": counts(20)}, ("motion", "factor"), TURN / 2**20, "2^20 = 1048576"),
]  # fmt: skip


SPEED, WEIGHT = KINDS[1:]


@pytest.mark.parametrize(
    ("kind", "mistake"),
    soaked(
        [(kind, row[0]) for kind in (SPEED, WEIGHT) for row in KNOWN],
        *((WEIGHT, row[0]) for row in KNOWN),
        *((SPEED, name) for name in ("degrees", "fine counts")),
    ),
)
def test_beside_nominal_values(kind: tuple[str, str], mistake: str, look: Look) -> None:
    (drive, output), (change, key, value, words) = kind, {row[0]: row[1:] for row in KNOWN}[mistake]
    looked = look(drive, output, columns=change)
    if "2^20" in words and output == "speed":  # beyond all that a speed can be
        assert "which no motor reaches: set torque.factor and speed.factor" in looked.faults[0]
        return
    (found,) = looked.corrections
    assert found.key == ((output, key[1]) if key[0] == "motion" else key)
    # A rated torque is known as well as the inertia is; the others are units, or powers of two.
    assert found.value == pytest.approx(value, rel=0.25 if "per mille" in words else 1e-6)
    assert words in found.reason


@pytest.mark.parametrize("mistake", ["degrees", "counts", "per mille"])
def test_beside_nothing_but_the_inertia(mistake: str, look: Look) -> None:
    """Frictions, which nobody knows beforehand, are not needed."""
    change, key, value, _ = {row[0]: row[1:] for row in KNOWN}[mistake]
    lacking = ("fm", "fc", "tau0")
    looked = look("one-mass", "angle", columns=change, lacking=lacking)
    (found,) = looked.corrections
    assert found.key[1] == key[1]
    assert found.value == pytest.approx(value, rel=0.25)
    assert not looked.unchecked


@pytest.mark.parametrize("friction", [True, False])
def test_counts_that_make_up_for_per_mille(friction: bool, look: Look) -> None:
    """The inertia is as the nominal one; only Coulomb friction, where it is given, shows both units."""
    change: Columns = {"u": lambda u: np.rint(1304 * u), "y": counts(13)}
    lacking = ("fm", "tau0") if friction else ("fm", "fc", "tau0")
    looked = look("one-mass", "angle", columns=change, lacking=lacking)
    if friction:
        torque, angle = looked.corrections
        assert torque.value == pytest.approx(1 / 1304, rel=0.3)
        assert is_change(angle, ("angle", "factor"), TURN / 2**13)
    else:
        assert looked.corrections == ()
        assert ["set torque.factor" in looked.doubts[0], "set angle.factor" in looked.doubts[1]] == [
            True,
            True,
        ]


def test_two_mistakes_in_a_torque(look: Look) -> None:
    found = look("one-mass", "angle", columns={"u": lambda u: np.rint(-1000 * u / 2.4)}).corrections
    assert [c.key for c in found] == [("torque", "factor")] * 2
    assert found[-1].value == pytest.approx(-2.4e-3, rel=0.25)


def test_the_angle_of_the_arm_and_a_ratio_the_other_way_round(look: Look) -> None:
    for known in (True, False):
        (found,) = look("one-mass-weight", "angle", known, {"y": lambda y: y * RATIO}).corrections
        assert is_change(found, ("angle", "factor"), 1 / RATIO)
        assert "that of the arm" in found.reason
        (found,) = look("one-mass-weight", "angle", known, r=1 / RATIO).corrections
        assert is_change(found, ("model", "nominal", "r"), RATIO)
        assert "the other way round" in found.reason


@pytest.mark.parametrize("unit", [DEGREES, TURN], ids=["degrees", "revolutions"])
def test_a_weight_shows_the_unit_of_the_angle(unit: float, look: Look) -> None:
    """It hangs on the true angle; the inertia is not known."""
    (found,) = look("one-mass-weight", "angle", False, {"y": lambda y: y / unit}).corrections
    assert is_change(found, ("angle", "factor"), unit)
    assert "the torque of the weight repeats" in found.reason


def test_no_motor_turns_so_fast(look: Look) -> None:
    (found,) = look("one-mass", "angle", False, IN_DEGREES).corrections
    assert is_change(found, ("angle", "factor"), DEGREES)
    looked = look("one-mass", "speed", False, IN_DEGREES)
    assert not looked.corrections  # revolutions per minute would do as well
    assert "0.10472 for revolutions per minute, 0.0174533 for degrees per second" in looked.doubts[0]


@pytest.mark.parametrize(
    ("change", "key"),
    [({"u": lambda u: np.rint(1000 * u / 2.4)}, "torque.factor"), ({"y": counts(13)}, "angle.factor")],
)
def test_what_no_record_tells(change: Columns, key: str, look: Look) -> None:
    looked = look("one-mass", "angle", False, change)
    assert looked.corrections == ()
    (words,) = looked.doubts
    assert f"set {key} to" in words
    assert "model.nominal" in looked.unchecked


def test_counts_hide_a_weight(look: Look) -> None:
    """Unless its period shows how many there are."""
    looked = look("one-mass-weight", "angle", False, {"y": counts(13)})
    if looked.corrections:
        assert is_change(looked.corrections[0], ("angle", "factor"), TURN / 2**13)
    else:
        assert "until then the weight of the arm cannot be found" in looked.doubts[0]


@pytest.mark.parametrize(
    ("names", "change", "key", "value"),
    [
        ("t,u,Pos_deg", IN_DEGREES, ("angle", "factor"), DEGREES),
        ("t,M1 [mNm],y", {"u": lambda u: 1e3 * u}, ("torque", "factor"), 1e-3),
    ],
)
def test_the_unit_in_the_name(names: str, change: Columns, key: tuple[str, str], value: float, look: Look) -> None:
    (found,) = look("one-mass", "angle", False, change, names).corrections
    assert is_change(found, key, value)
    # The inertia is known, and fits as it is: the name of the column is not right.
    assert look("one-mass", "angle", True, names=names).corrections == ()


@pytest.mark.parametrize("period", [360.0, TURN, 65536.0])
def test_an_angle_that_starts_again(period: float, look: Look) -> None:
    unit = {360.0: DEGREES, TURN: 1.0, 65536.0: TURN / 2**13}[period]

    def start_again(y: Floats) -> Floats:
        return np.asarray(np.mod(np.rint(y / unit) if period == 65536 else y / unit, period))

    looked = look("one-mass", "angle", columns={"y": start_again})
    found = {c.key: c.value for c in looked.corrections}
    assert found[("angle", "wrap_period")] == pytest.approx(period)
    assert found.get(("angle", "factor"), 1.0) == pytest.approx(unit)


def test_a_table_that_stands_for_long_turns_on_and_does_not_stick(tmp_path: Path) -> None:
    """A coarse encoder says the same all the time that the axis stands; so it does where the angle starts again."""
    t = np.arange(30_000) * 0.004
    rest = np.minimum(t % 10 / 4, 1.0)  # 4 s of motion, 6 s of rest
    angle = TURN / 4 * (t // 10 + rest**3 * (10 - 15 * rest + 6 * rest**2))
    speed = np.gradient(angle, 0.004)
    torque = 4 * np.gradient(speed, 0.004) + 2 * np.tanh(speed / 0.01)
    degrees = np.mod(np.rint(angle / DEGREES / 0.005) * 0.005, 360)
    path = tmp_path / "record.csv"
    np.savetxt(path, np.column_stack([t, torque, degrees]), "%.12g", ",", header="t,u,y", comments="")
    text = ROBOT + axis_text("one-mass", "angle", False, J=4.0).replace('"y"', f'"y", factor = {DEGREES}')
    looked = review(
        text.replace(f"sample_interval_s = {H}", "sample_interval_s = 0.004"),
        "cell.a1",
        [str(path)],
        tmp_path,
    )
    assert {c.key: c.value for c in looked.corrections}[("angle", "wrap_period")] == pytest.approx(360)
    assert looked.faults == ()


# --- Broken signals ---------------------------------------------------------------------------------------------------


def frozen(values: Floats) -> Floats:
    out = values.copy()
    out[1600:] = out[1600]
    return out


def lost(values: Floats) -> Floats:
    """From far away to zero, and back after 2.5 s."""
    out = values.copy()
    start = 1500 + int(np.argmax(abs(values[1500:2500])))
    out[start : start + 500] = 0.0
    return out


def held(values: Floats) -> Floats:
    return np.repeat(values[::2], 2)[: len(values)]


def again(values: Floats) -> Floats:
    return np.asarray(np.where(values < values[1500], values, values - values[1500]))


def still(values: Floats) -> Floats:
    return np.full_like(values, values[0])


BROKEN: list[tuple[str, Columns, str]] = [
    ("stuck motion", {"y": frozen}, "column y (the {output}) is stuck, while the axis moves, from 8.00 to 19.99 s"),
    ("lost motion", {"y": lost}, "column y (the {output}) is stuck, while the axis moves, from "),
    ("stuck torque", {"u": frozen}, "column u (the torque) is stuck, while the axis moves, from 8.00 to 19.99 s"),
    ("constant torque", {"u": still}, "column u (the torque) is "),
    ("constant motion", {"y": still}, "column y (the {output}) is "),
    ("two records", {"t": again}, "start again, so that "),
    ("held motion", {"y": held}, "column y (the {output}) changes only in every second sample"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "broken"),
    soaked(
        [(kind, row[0]) for kind in (SPEED, WEIGHT) for row in BROKEN],
        *((SPEED, row[0]) for row in BROKEN),
        (WEIGHT, "held motion"),
    ),
)
def test_broken_signals(kind: tuple[str, str], broken: str, look: Look) -> None:
    (drive, output), (change, words) = kind, {row[0]: row[1:] for row in BROKEN}[broken]
    looked = look(drive, output, columns=change)
    assert looked.corrections == ()
    (fault,) = looked.faults
    assert words.format(output=output) in fault
    if "held" in words:
        assert f"sample_interval_s = {2 * H:g}" in fault


# --- Healthy axes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("drive", "output"), KINDS)
@pytest.mark.parametrize("more", soaked([0, 1], 0))
def test_a_healthy_axis_is_left_alone(drive: str, output: str, more: int, tmp_path: Path, seed: int) -> None:
    for known in (True, False):
        assert looked_at(tmp_path, seed + more, drive, output, known)[:3] == ((), (), ())


REAL = [
    ("irb/robot_arm.mat", 5e-4, "", "torque", "speed", "speed"),
    ("emps/DATA_EMPS.mat", 1e-3, "t", "vir", "qm", "angle"),
    *(
        (f"ur10e/{name}.csv", 0.011, "0", str(12 + axis), str(axis), "angle")
        for name, axis in (
            ("ur-20_01_22-joint_1", 1),
            ("ur-20_01_22-joint_2", 2),
            *(("ur-20_02_19_14harm50sec", axis) for axis in range(1, 7)),
        )
    ),
]


@pytest.mark.parametrize(("file", "interval", "time", "torque", "motion", "output"), soaked(REAL, *REAL[:3], REAL[-1]))
def test_real_axes_are_left_alone(
    file: str, interval: float, time: str, torque: str, motion: str, output: str,
    tmp_path: Path, records_dir: Path,
) -> None:  # fmt: skip
    record = records_dir / file
    text = ROBOT + axis_text("one-mass", output, known=False).replace(str(H), str(interval))
    for name, column in (("t", time), ("u", torque), ("y", motion)):
        text = text.replace(f'column = "{name}"', f'column = "{column}"')
    text = text if time else text.replace('time = { column = "" }\n', "")
    looked = review(text, "cell.a1", [str(record)], tmp_path)
    assert [c for c in looked.corrections if c.key != ("sample_interval_s",)] == []
    assert (looked.faults, looked.doubts) == ((), ())


def test_a_real_axis_with_mistakes(tmp_path: Path, records_dir: Path) -> None:
    """The sign, and degrees, of the irb record beside the published inertia."""
    content = scipy.io.loadmat(records_dir / "irb/robot_arm.mat", simplify_cells=True)
    scipy.io.savemat(
        tmp_path / "wrong.mat",
        {"u": -content["torque"], "y": content["speed"] / DEGREES},
        do_compression=False,
    )
    text = ROBOT + axis_text("one-mass", "speed", known=True, J=0.033).replace(str(H), "0.0005")
    looked = review(text.replace('time = { column = "t" }\n', ""), "cell.a1", [str(tmp_path / "wrong.mat")], tmp_path)
    assert {c.key: c.value for c in looked.corrections} == {
        ("torque", "factor"): -1.0,
        ("speed", "factor"): pytest.approx(DEGREES),
    }


def test_a_position_in_mm_is_no_angle_in_degrees(look: Look) -> None:
    """Its numbers are as large as those of an angle in degrees; only its name tells."""
    for names, corrected in (("t,u,y", True), ("t,u,y_mm", False)):
        looked = look("one-mass", "angle", False, IN_DEGREES, names)
        assert [c.key for c in looked.corrections] == [("angle", "factor")] * corrected


def test_a_unit_below_the_name_is_taken_as_one_in_it(tmp_path: Path, seed: int) -> None:
    m = moves("one-mass", seed)
    path = tmp_path / "record.csv"
    columns = np.column_stack([m.t, m.torque, m.angle / DEGREES])
    np.savetxt(path, columns, "%.12g", ",", header="# export\nt,u,y\ns,Nm,deg", comments="")
    (found,) = review(ROBOT + axis_text("one-mass", "angle", False), "cell.a1", [str(path)], tmp_path).corrections
    assert is_change(found, ("angle", "factor"), DEGREES)
    assert "in degrees: deg" in found.reason


def test_an_angle_that_only_begins_elsewhere_stands(look: Look) -> None:
    """Its first sample alone is another one."""
    looked = look("one-mass", "angle", columns={"y": lambda y: np.where(np.arange(y.size) < 1, 0.5, 0.2)})
    assert "is 0.2 nearly throughout" in looked.faults[0]
    assert "the axis did not move, or the signal is stuck" in looked.faults[0]
