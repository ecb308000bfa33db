"""``axiswatch init`` where the values of columns tell more than their names: units, sides of the gear, axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.service.command_line import shown
from tests.service.commands.commissioning.two_mass_tables import read_rows, write_rows
from tests.service.commands.proposals import proposed, rename_columns

# --- Units, wraps and sides of the gear -------------------------------------------------------------------------------


def test_an_angle_that_starts_again_is_judged_by_its_motion(record: Path) -> None:
    rows = read_rows(record)
    turned = np.column_stack([rows[:, 0], -rows[:, 1], np.degrees(rows[:, 2]) % 360])
    write_rows(record, turned, "Time,Trq,Pos_deg")
    assert "torque Trq, angle Pos_deg: sure" in shown("init", record)
    (axis,) = proposed()
    assert axis.angle is not None
    assert (axis.torque.factor, axis.angle.wrap_period) == (-1, 360)


@pytest.mark.usefixtures("folder")
def test_a_fast_motor_angle_of_a_slow_recorder(seed: int) -> None:
    """Every 12 ms, at up to 1400 turns a minute, rows missing: it moves a hundred degrees in a sample."""
    rng = np.random.default_rng(seed)
    t = np.arange(5000) * 0.012
    accelerations = np.repeat(rng.uniform(-300, 300, 250), 20)
    speed = 150 * np.sin(np.cumsum(accelerations) * 0.012 / 150)
    torque = 0.004 * np.gradient(speed, t) + 0.002 * speed + 0.1 * np.tanh(speed)
    rows = np.column_stack([t * 1e3, torque, np.degrees(np.cumsum(speed) * 0.012) % 360])
    kept = rows[rng.random(len(rows)) > 0.004]
    np.savetxt("plc.csv", kept, "%.6g", ",", header="TimeMs,Current [A],MotorAngle [deg]", comments="")
    shown("init", "plc.csv")
    (axis,) = proposed()
    assert axis.angle is not None
    assert (axis.torque.factor, axis.angle.wrap_period) == (1, 360)


def test_units_in_names(record: Path) -> None:
    rename_columns(record, "Time,A1_Trq_mNm,A1_Pos_deg,A2_Trq [Nm],A2_Pos")
    assert "sure" in shown("init", record)
    first, second = proposed()
    assert first.torque.factor == 0.001
    assert first.motion.factor == pytest.approx(0.0174532925)
    assert (second.torque.factor, second.motion.factor) == (1, 1)


def test_units_below_the_names(record: Path) -> None:
    """Of an axis its current, of the other its torque; a linear axis; times in milliseconds; remarks above."""
    lines = record.read_text(encoding="utf-8").splitlines()
    head = ["# export", "Zeit,A1,Achse1,A2.Torque,A2.ActPos", "[ms],[mA],[deg],[%],[mm]"]
    rows = [line.split(",") for line in lines[1:]]
    late = [",".join([f"{1e3 * float(t):.1f}", *cells]) for t, *cells in rows]
    record.write_text("\n".join([*head, *late]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert "axis1: torque A1 [mA], angle Achse1 [deg]: sure" in text
    assert "axis2: torque A2.Torque [%], angle A2.ActPos [mm]: sure" in text
    first, second = proposed()
    assert (first.time.factor, first.torque.factor) == (0.001, 0.001)
    assert first.motion.factor == pytest.approx(0.0174532925)
    assert (second.torque.factor, second.motion.factor) == (1, 1)
    written = Path("axis.toml").read_text(encoding="utf-8")
    assert "a current: add kT_Nm_per_A" in written
    assert "in percent of the rated torque; factor is rated torque / 100 [N m]" in written
    assert "in mm of a linear axis; factor is 2 pi / (mm that a turn of the motor moves it)" in written


def test_the_side_of_the_gear_is_told_by_the_speed_where_it_tells(record: Path) -> None:
    """In degrees: of the arm behind a gear of 1 to 100, of a motor that is as fast as servo motors are."""
    rows = read_rows(record)
    fastest = np.quantile(np.abs(rows[10:, 2] - rows[:-10, 2]), 0.999) / 0.05
    for rad_s, words in (
        (2.5, "of the arm, as it reaches 2.5 rad/s only: for that of the motor multiply factor by the gear ratio"),
        (50.0, ""),
        (250.0, "of the motor, as it reaches 250 rad/s; if it turns an arm, add r to nominal"),
    ):
        angle = np.degrees(rows[:, 2] * rad_s / fastest)
        columns = np.column_stack([rows[:, 0] - rows[0, 0], rows[:, 1], angle])
        write_rows(record, columns, "Time,Trq [Nm],Pos [deg]")
        shown("init", record, "--force")
        (line,) = (x for x in Path("axis.toml").read_text("utf-8").splitlines() if x.startswith("angle"))
        assert (words in line) if words else "likely of the" not in line


def test_the_gear_ratios_of_a_robot_are_asked_for_where_its_angles_are_those_of_motors(record: Path) -> None:
    """A single axis has no pose that its load could follow."""
    rows = read_rows(record)
    fastest = np.quantile(np.abs(rows[10:, 2::2] - rows[:-10, 2::2]), 0.999, axis=0) / 0.05
    for axes, rad_s, asked in (
        (2, (250.0, 250.0), "axis1 and axis2: likely the angles of motors."),
        (2, (50.0, 250.0), "axis1 and axis2: likely the angles of motors."),
        (2, (5.0, 250.0), "axis2: likely the angles of motors."),
        (2, (50.0, 50.0), ""),
        (1, (250.0,), ""),
    ):
        columns = rows[:, : 1 + 2 * axes].copy()
        columns[:, 0] -= rows[0, 0]
        columns[:, 2::2] *= np.array(rad_s) / fastest[:axes]
        write_rows(
            record,
            columns,
            ",".join(["Time", "A1_Trq [Nm]", "A1_Pos [rad]", "A2_Trq [Nm]", "A2_Pos [rad]"][: 1 + 2 * axes]),
        )
        text = shown("init", record, "--force")
        assert (asked in text) if asked else "angles of motors" not in text


@pytest.mark.parametrize(
    ("axes", "speed", "motion", "asked"),
    [(2, 60.0, "Pos", True), (2, 3.0, "Pos", False), (2, 60.0, "Pos [rad]", False), (1, 60.0, "Pos", False)],
)
def test_angles_without_a_unit_may_be_in_degrees(
    record: Path, axes: int, speed: float, motion: str, asked: bool
) -> None:
    """Arms are slower in rad; a single axis has no pose."""
    rows = read_rows(record)[:, : 1 + 2 * axes]
    rows[:, 0] -= rows[0, 0]
    fastest = np.quantile(np.abs(rows[10:, 2::2] - rows[:-10, 2::2]), 0.999, axis=0) / 0.05
    rows[:, 2::2] *= speed / fastest
    names = ["Time", "A1_Trq", f"A1_{motion}", "A2_Trq", f"A2_{motion}"]
    write_rows(record, rows, ",".join(names[: 1 + 2 * axes]))
    found = [line for line in shown("init", record).splitlines() if line.startswith("angles without a unit")]
    words = "angles without a unit (axis1 and axis2) are taken as rad; if they are in degrees, add factor = 0.0174533"
    assert [line.partition(" to each")[0] for line in found] == [words] * asked


def test_speeds_without_a_unit_are_not_asked_about(record: Path) -> None:
    rows = read_rows(record)
    rows[:, 0] -= rows[0, 0]
    rows[:, 2::2] = 60 * np.gradient(rows[:, 2::2], 0.005, axis=0)
    write_rows(record, rows, "Time,A1_Trq,A1_Vel,A2_Trq,A2_Vel")
    assert "angles without a unit" not in shown("init", record)


@pytest.mark.parametrize("name", ["Achse 1 Istposition (Grad)", "Pos_deg(:,1)", "Winkel [deg]"])
def test_degrees(record: Path, name: str) -> None:
    rename_columns(record, f'Time,A1_Trq,"{name}",A2_Trq,A2_Pos')
    shown("init", record)
    factors = {axis.motion.column: axis.motion.factor for axis in proposed()}
    assert factors[name] == pytest.approx(np.pi / 180)


# --- Values -----------------------------------------------------------------------------------------------------------


def test_values_alone(record: Path) -> None:
    """Without names, times in milliseconds, one torque turned, a speed beside its angle, a wanted angle."""
    rows = read_rows(record)
    t = 1e3 * (rows[:, 0] - rows[0, 0])
    first, second = (np.gradient(rows[:, k], 0.005) for k in (2, 4))
    columns = np.column_stack([t, rows[:, 2], first, -rows[:, 1], rows[:, 3], rows[:, 4], second, 0 * t])
    write_rows(record, columns, "")
    text = shown("init", record)
    assert "not used: 2, 6, 7" in text
    a, b = proposed()
    assert (a.torque.column, a.motion.column, a.torque.factor) == ("3", "1", -1)
    assert (b.torque.column, b.motion.column, b.torque.factor) == ("4", "5", 1)
    assert a.time.factor == 0.001
    assert a.sample_interval_s == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("part", "words"),
    [("tau_contact_1", "likely; or torque tau_contact_1 ("), ("tau_ext_1", "sure ("), ("torque_sensor_1", "sure (")],
)
def test_a_part_of_a_torque_is_not_the_torque(record: Path, part: str, words: str, seed: int) -> None:
    """Such as that of a contact, which explains the motion of a free axis as well, but is small; what is no torque.

    By its name a torque acts from outside, or is that of a sensor behind the friction of the gear.
    """
    rows = read_rows(record)
    noise = 1e-4 * np.ptp(rows[:, 1]) * np.random.default_rng(seed).standard_normal(len(rows))
    small = 0.1 * rows[:, 1] + noise
    table = np.column_stack([rows[:, 0] - rows[0, 0], small, rows[:, 2] + noise, rows[:, 1], rows[:, 2], small])
    write_rows(record, table, f"Time,{part},error_q_1,tau_1,q_1,tau_ff_1")
    assert f"axis1: torque tau_1, angle q_1: {words}" in shown("init", record)


def test_torques_of_axes_whose_names_do_not_tell_them_apart_are_not_parts(record: Path) -> None:
    """The torque of the second axis follows no motion, and that of the first one is far larger."""
    rows = read_rows(record)
    rows[:, 3] = 0.1 * np.std(rows[:, 1]) * np.resize([1.0, -1.0], len(rows))
    write_rows(record, rows, "t,/states/pan/effort,/states/pan/position,/states/lift/effort,/states/lift/position")
    shown("init", record)
    found = [(a.torque.column, a.motion.column) for a in proposed()]
    assert found == [(f"/states/{name}/effort", f"/states/{name}/position") for name in ("pan", "lift")]


def test_an_angle_under_a_weight_is_no_speed(record: Path, seed: int) -> None:
    """Its torque follows the angle as friction would follow a speed; but it rests where it likes."""
    rng = np.random.default_rng(seed)
    t = 0.005 * np.arange(4000)
    stops, share = rng.uniform(0.3, 1.5, 22), np.clip(t % 1.0 / 0.6, 0, 1)
    angle = np.interp(np.floor(t) + share**2 * (3 - 2 * share), np.arange(22), stops)
    speed = np.gradient(angle, t)
    torque = 20 * angle + np.gradient(speed, t) + 3 * np.tanh(30 * speed) + 0.3 * rng.standard_normal(4000)
    write_rows(record, np.column_stack([t, torque, angle]), "")
    assert "torque 1, angle 2" in shown("init", record)


def test_all_motions_of_a_table_are_one_quantity(record: Path, seed: int) -> None:
    """Three axes without names.  A weight on one of them makes its angle a better speed than angle; the others tell."""
    rng = np.random.default_rng(seed)
    t = 0.005 * np.arange(6000)
    angles = np.array([[0.5 * np.sin(w * t + p), 0.2 * np.sin(2.3 * w * t)] for w, p in ((0.7, 0), (0.9, 1), (1.1, 2))])
    q = angles.sum(axis=1)
    speed = np.gradient(q, t, axis=1)
    u = np.gradient(speed, t, axis=1) + 0.5 * speed + 2 * np.tanh(speed / 0.02) + 0.1 * rng.standard_normal(q.shape)
    u[1] += 40 * np.sin(q[1])
    write_rows(record, np.vstack([q, u]).T, "")
    text = shown("init", record)
    for axis in range(3):
        assert f"axis{axis + 1}: torque {axis + 3}, angle {axis}: " in text
    assert [axis.torque.factor for axis in proposed()] == [1, 1, 1]


def test_axes_of_an_arm_in_a_table_without_names(record: Path, seed: int) -> None:
    """Angles, speeds and torques of four axes; the links hide which torque belongs to the motions of two of them."""
    rng = np.random.default_rng(seed)
    t = 0.005 * np.arange(6000)
    phases, rates = ((0, 1), (2, 3), (4, 5), (6, 7)), (0.8, 0.9, 1.1, 1.3)
    q = np.array(
        [0.5 * np.sin(w * t + a) + 0.2 * np.sin(2.3 * w * t + b) for w, (a, b) in zip(rates, phases, strict=True)]
    )
    speed = np.gradient(q, t, axis=1)
    u = np.gradient(speed, t, axis=1) + 0.5 * speed + 2 * np.tanh(speed / 0.02) + 0.1 * rng.standard_normal(q.shape)
    u[1] += 30 * np.sin(4 * q[0] + 6 * q[2])
    u[2] += 30 * np.sin(6 * q[3] - 4 * q[0])
    write_rows(record, np.vstack([q, speed, u]).T, "")
    text = shown("init", record)
    for axis, sure in enumerate(("sure", "by place in the table only", "by place in the table only", "sure")):
        assert f"axis{axis + 1}: torque {axis + 8}, angle {axis}: {sure} (" in text
    assert "# by place in the table only: factor makes it N m\n" in Path("axis.toml").read_text("utf-8")
    write_rows(record, np.vstack([q, speed, u[0], u[3], u[1], u[2]]).T, "")
    assert "by place" not in shown("init", record, "--force")  # the torques of two axes are elsewhere


def test_the_speed_of_an_angle_with_a_name_is_no_torque(record: Path) -> None:
    """A motion explains its own speed as friction, all of it."""
    rows = read_rows(record)
    columns = [rows[:, 0], rows[:, 2], np.gradient(rows[:, 2], 0.005), rows[:, 1]]
    write_rows(record, np.column_stack(columns), "t,q_1,b_1,c_1")
    assert "axis1: torque c_1, angle q_1: sure" in shown("init", record)


@pytest.mark.parametrize("faulty_rows", [0, 30])
def test_columns_in_blocks_without_names(record: Path, faulty_rows: int, seed: int) -> None:
    """Angles, speeds, measured and wanted torques, each of all axes: the measured torque in step with its angle.

    The axes make the same motion, so that each torque explains each of them.
    """
    rng = np.random.default_rng(seed)
    rows = read_rows(record)
    angle, torque = rows[:, 2], rows[:, 1]
    noise = 0.05 * np.ptp(torque) * rng.standard_normal((len(torque), 2))
    wanted = np.convolve(torque, np.ones(5) / 5, "same")
    blocks = [angle, -2 * angle, np.gradient(angle, 0.005), -2 * np.gradient(angle, 0.005)]
    blocks += [torque + noise[:, 0], -3 * torque + noise[:, 1], wanted, -3 * wanted]
    table = np.column_stack([rows[:, 0] - rows[0, 0], *blocks])
    for row in rng.choice(np.arange(1, len(table) - 1), faulty_rows, replace=False):
        table[row, 1:] = rng.choice([0.0, 253.0, 1e293, -7e18], 8)
    write_rows(record, table, "")
    assert "not used: 3, 4, 7, 8" in shown("init", record)
    found = [(a.torque.column, a.motion.column) for a in proposed()]
    assert found == [("5", "1"), ("6", "2")]


def test_an_axis_that_nearly_always_stands(record: Path, seed: int) -> None:
    """It moves in one row of 130: that is no fault of the file, although its torque is far above its noise there."""
    rng = np.random.default_rng(seed)
    rows = read_rows(record)
    torque = np.zeros(len(rows))
    torque[1000:1015], torque[1015:1030] = 5.0, -5.0
    speed = np.cumsum(torque / 0.01 * 0.005)
    rows[:, 3] = torque + 1e-3 * rng.standard_normal(len(rows))
    rows[:, 4] = np.cumsum(speed * 0.005) + 1e-5 * rng.standard_normal(len(rows))
    write_rows(record, rows, "Time,A1_Trq,A1_Pos,A2_Trq,A2_Pos")
    assert "axis2: torque A2_Trq, angle A2_Pos: sure" in shown("init", record)


def test_two_torques_that_may_be_measured_are_both_named(record: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = read_rows(record)
    angle, torque = rows[:, 2], rows[:, 1]
    rough = [torque + 0.05 * np.ptp(torque) * rng.standard_normal(len(torque)) for _ in range(2)]
    # Of two axes, the second of which stands: what is of one quantity takes two columns.
    columns = [rows[:, 0] - rows[0, 0]]
    for quantity in (angle, np.gradient(angle, 0.005), *rough):
        columns += [quantity, np.zeros(len(angle))]
    write_rows(record, np.column_stack(columns), "")
    text = shown("init", record)
    assert "torque 5, angle 1: likely; or torque 7" in text or "torque 7, angle 1: likely; or torque 5" in text


@pytest.mark.parametrize(("noise", "kind"), [((0.5, 2.0), "motor"), ((2.0, 0.5), "motor"), ((2.0, 2.0), "joint")])
def test_angles_of_motor_and_joint(noise: tuple[float, float], kind: str, record: Path, seed: int) -> None:
    """All axes take the kind of angle that most have the better one of; of equals, that of the torques."""
    rng = np.random.default_rng(seed)
    rows = read_rows(record)
    names, columns = ["Time"], [rows[:, 0]]
    for axis, of_joint in enumerate(noise, 1):
        torque, angle = rows[:, 2 * axis - 1], rows[:, 2 * axis]
        rough = 1e-5 * np.ptp(angle) * rng.standard_normal(len(angle))
        names += [f"motor_torque_{axis}", f"motor_position_{axis}", f"joint_position_{axis}"]
        columns += [torque, angle + rough, angle + of_joint * rough]
    write_rows(record, np.column_stack(columns), ",".join(names))
    text = shown("init", record)
    other = "joint" if kind == "motor" else "motor"
    for axis in (1, 2):
        expected = f"torque motor_torque_{axis}, angle {kind}_position_{axis}: likely; or angle {other}_position_{axis}"
        assert expected in text
