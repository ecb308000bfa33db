"""``axiswatch init``: columns become axes, by their names and by their values."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from service.config import AxisConfig, load
from service.ingest.roles_by_name import axis_number, role_of
from tests import golden
from tests.service.command_line import axiswatch, refused, session, shown
from tests.service.commands.commissioning.two_mass_tables import read_rows, table, write_rows


@pytest.fixture
def record(folder: Path, seed: int) -> Path:
    """A table of two axes with names: Time, A1_Trq, A1_Pos, A2_Trq, A2_Pos."""
    return table(folder / "record.csv", seed, 20.0, axes=2)


def proposed() -> list[AxisConfig]:
    return [axis.config for axis in load(Path("axis.toml")).axes]


def rename_columns(record: Path, names: str) -> None:
    _, _, rows = record.read_text(encoding="utf-8").partition("\n")
    record.write_text(f"{names}\n{rows}", encoding="utf-8")


# --- Names ------------------------------------------------------------------------------------------------------------


def test_names_of_columns(record: Path) -> None:
    text = shown("init", record)
    assert "axis1: torque A1_Trq, angle A1_Pos: sure" in text
    assert "Next: axiswatch commission" in text
    first, second = proposed()
    assert (first.torque.column, first.motion.column) == ("A1_Trq", "A1_Pos")
    assert (second.torque.column, second.motion.column) == ("A2_Trq", "A2_Pos")
    assert first.sample_interval_s == pytest.approx(0.005)
    assert first.time.column == "Time"


def test_an_axis_that_stands_is_found_by_its_names(record: Path, seed: int) -> None:
    """Its encoder and its current are noise."""
    rows = read_rows(record)
    rows[:, 3:] = np.random.default_rng(seed).standard_normal((len(rows), 2)) * [0.01, 1e-6] + [0.2, 1.0]
    write_rows(record, rows, "t,A1_Trq,A1_Pos,A2_Trq,A2_Pos")
    assert "axis2: torque A2_Trq, angle A2_Pos: likely by its name; it did not move\n" in shown("init", record)


def test_exchanged_columns_are_noticed(record: Path) -> None:
    """The names are believed, and what speaks against them is said."""
    assert "are two columns exchanged" not in shown("init", record)
    rename_columns(record, "Time,A2_Trq,A1_Pos,A1_Trq,A2_Pos")
    first, second = (line for line in shown("init", record, "--force").splitlines() if line[:4] == "axis")
    assert "torque A1_Trq, angle A1_Pos" in first
    assert "; A2_Pos explains " in first
    assert "; A1_Pos explains " in second
    assert second.endswith("% of it: are two columns exchanged?")


@pytest.mark.parametrize(
    ("names", "alone"),
    [
        ("A1_Trq,A1_Pos,A2_Trq [Nm],Height [cm]", ["A2_Trq [Nm]"]),
        ("A1_Trq,A1_Pos,A1_Current [A],x", []),
        ("A1_Trq,A1_Pos,A2_TrqRef,x", []),
        ("A1_Trq,A1_Pos,Tool_current,x", []),
        ("X_Trq,X_Pos,Y_Trq [Nm],Height [cm]", ["Y_Trq [Nm]"]),
    ],
)
def test_a_torque_whose_motion_no_name_tells_is_not_left_out_silently(
    record: Path, names: str, alone: list[str]
) -> None:
    rename_columns(record, f"Time,{names}")
    lines = shown("init", record).splitlines()
    assert len(proposed()) == 1
    assert [x for x in lines if "without its motion" in x] == [
        f"{name} is a torque without its motion: add its axis to axis.toml" for name in alone
    ]


def test_axes_that_move_together_are_not_exchanged(record: Path) -> None:
    """The motion of the first axis explains both torques, its own one, too: it is where it belongs."""
    names, *rows = record.read_text(encoding="utf-8").splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    values[:, 3] = values[:, 1] + 0.2 * values[:, 3]
    np.savetxt(record, values, delimiter=",", header=names, comments="", fmt="%.9g")
    first, second = (line for line in shown("init", record).splitlines() if line[:4] == "axis")
    assert "sure" in first
    assert "sure" not in second
    assert "exchanged" not in first + second


def test_torque_and_angle_of_one_axis_that_are_exchanged_are_noticed(record: Path) -> None:
    rename_columns(record, "Time,A1_Pos,A1_Trq,A2_Trq,A2_Pos")
    first, second = (line for line in shown("init", record, "--force").splitlines() if line[:4] == "axis")
    assert first.endswith("% if they change places: are the two columns exchanged?")
    assert "exchanged" not in second


@pytest.mark.parametrize(
    ("names", "axes"),
    [
        ("X.ActTrq[%],X.ActPos[deg],C.ActTrq[%],C.ActPos[deg]", ["axisX", "axisC"]),
        ("J1.ActTrq[%],J1.ActPos[deg],Z.ActTrq[%],Z.ActPos[mm]", ["axis1", "axisZ"]),
        ("Torque_J1 [Nm],J1 [deg],Torque_J3 [Nm],J3 [mm]", ["axis1", "axis3"]),
        ("Torque_J1 [Nm],J1 [deg],Torque_Z [Nm],Z [mm]", ["axis1", "axisZ"]),
        (
            "Band.Moment [Nm],Band.Istdrehzahl [1/min],Hub.Moment [Nm],Hub.Istdrehzahl [1/min]",
            ["band", "hub"],
        ),
        ("Trq_Shoulder,Pos_Shoulder,Trq_Elbow,Pos_Elbow", ["shoulder", "elbow"]),
        ("/joint1/effort,/joint1/position,/joint2/effort,/joint2/position", ["axis1", "axis2"]),
        ("J1 Torque ref,J1 Position,A2_Sollmoment,A2_Istwinkel", ["axis1", "axis2"]),
        ("S-Axis Torque[%],S-Axis Feedback Pulse,T-Axis Torque[%],T-Axis Feedback Pulse", ["axisS", "axisT"]),
        ("gAxis01.TORQUE_ACT,gAxis01.PCTRL_S_ACT,gAxis02.TORQUE_ACT,gAxis02.PCTRL_S_ACT", ["axis01", "axis02"]),
        ("motor_torque_1,q_1,torque_sensor_2,q_2", ["axis1", "axis2"]),
        ("left motor torque,right arm angle,motor torque,arm angle", ["axis1", "axis2"]),
    ],
)
def test_axes_are_named_by_what_tells_them_apart(record: Path, names: str, axes: list[str]) -> None:
    """A torque that a drive is asked for is one, too, where no other is recorded."""
    rename_columns(record, f"Time,{names}")
    shown("init", record)
    found = proposed()
    assert [axis.name for axis in found] == axes
    columns = names.split(",")
    assert [axis.torque.column for axis in found] == columns[::2]
    assert [axis.motion.column for axis in found] == columns[1::2]


def test_a_command_that_its_name_does_not_show(record: Path, seed: int) -> None:
    """It is smoother than the measured angle, which is proposed although it stands behind, and both are named."""
    rows = read_rows(record)
    noise = 1e-3 * np.ptp(rows[:, 2]) * np.random.default_rng(seed).standard_normal(len(rows))
    table = np.column_stack([rows[:, 0] - rows[0, 0], rows[:, 1], rows[:, 2], rows[:, 2] + noise])
    write_rows(record, table, "Time,MACur.A1,ASPos.A1,AIPos.A1")
    assert "axis1: torque MACur.A1, angle AIPos.A1: likely; or angle ASPos.A1" in shown("init", record)
    write_rows(record, table, "Time,Channel 1,Channel 2,Channel 3")
    assert "torque Channel 1, angle Channel 3: likely; or angle Channel 2" in shown("init", record, "--force")


@pytest.mark.parametrize("others", ["tau_ref_2,q_cmd_2", "tau_1_d,q_1_d", "computed_torque_1,target_q_1"])
def test_what_the_controller_asks_for_is_no_measurement(record: Path, others: str) -> None:
    """Also where it has the name of what is measured, and "_d" for desired."""
    rename_columns(record, f"t,tau_1,q_1,{others}")
    assert f"not used: {others.replace(',', ', ')}" in shown("init", record)
    assert [axis.name for axis in proposed()] == ["axis1"]


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("A1_Motorstrom", "current"),
        ("Achse 2 Istwinkel", "angle"),
        ("Istposition_3", "angle"),
        ("Motordrehzahl", "speed"),
        ("A1_Sollwinkel", "wanted"),
        ("Sollstrom", "wanted"),
        ("Achse 1 Lageistwert", "angle"),
        ("Momentenistwert", "torque"),
        ("Drehzahlsollwert_2", "wanted"),
        ("Drahtvorschub", ""),
        ("AIPos.A1", "angle"),
        ("TorqueReference", "wanted"),
        ("Consigne couple", "wanted"),
        ("Axis_X.PositionError", "other"),
        ("torque_ff_ref", "other"),
        ("PCTRL_S_ACT", ""),
        ("t_s", "time"),
    ],
)
def test_words_of_loggers(name: str, role: str) -> None:
    """Of German compound words, of words without a space between them; what is neither measured nor commanded."""
    assert role_of(name) == role


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("Axis 2 S-0-0084 Torque", "2"),
        ("SERVO_1.r63[0]", "1"),
        ("gAxis[3].Drive0", "3"),
        ("A4_Pos", "4"),
        ("field.effort0", "0"),
        ("17", ""),
    ],
)
def test_the_number_of_an_axis(name: str, number: str) -> None:
    """It stands behind a word for an axis, otherwise last; a column that is called by its place has none."""
    assert axis_number(name) == number


# --- Further signals --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "axes"),
    [
        ("Hub.Last [kg]", ["hub"]),
        ("Payload", ["band", "hub"]),
        ("Hub.Load [%]", []),
        ("Hub.LastError", []),
    ],
)
def test_a_measured_load_is_a_signal(record: Path, column: str, axes: list[str]) -> None:
    """Of its axis, or of all; that of a motor is none."""
    _, _, rows = record.read_text(encoding="utf-8").partition("\n")
    names = "Time,Band.Moment [Nm],Band.Istwinkel [deg],Hub.Moment [Nm],Hub.Istwinkel [deg]"
    loaded = [f"{row},{k // 500}" for k, row in enumerate(rows.splitlines())]
    record.write_text("\n".join([f"{names},{column}", *loaded]), encoding="utf-8")
    text = shown("init", record)
    found = proposed()
    assert [axis.name for axis in found] == ["band", "hub"]
    assert [a.name for a in found if [s.column for s in a.signal] == [column]] == axes
    assert (f"not used: {column}" in text) == (not axes)


@pytest.mark.parametrize(
    ("columns", "found_columns"),
    [
        (["joint_temperatures_1", "joint_temperatures_2"], ["joint_temperatures_1", "joint_temperatures_2"]),
        (["Motor 1 [°C]", "Temp_Getriebe_1", "Temperatur_Umrichter_2"], ["Temp_Getriebe_1", "Temperatur_Umrichter_2"]),
        (["Cabinet temperature"], [None, None]),
    ],
)
def test_the_temperature_of_an_axis_is_a_signal(
    record: Path, columns: list[str], found_columns: list[str | None]
) -> None:
    """Of several that of the gear; that of a cabinet is of no axis."""
    _, _, rows = record.read_text(encoding="utf-8").partition("\n")
    names = "Time,A1 Moment [Nm],A1 Istwinkel [deg],A2 Moment [Nm],A2 Istwinkel [deg]"
    warmer = [",".join([row, *(str(25 + k // 900) for _ in columns)]) for k, row in enumerate(rows.splitlines())]
    record.write_text("\n".join([",".join([names, *columns]), *warmer]), encoding="utf-8")
    text = shown("init", record)
    signals = [{s.name: s.column for s in axis.signal}.get("temperature") for axis in proposed()]
    assert signals == found_columns
    for column in columns:
        assert (f"not used: {column}" in text or f", {column}" in text) or column in found_columns
    assert ("temperatures, which friction may follow: axis1: " in text) == any(found_columns)


@pytest.mark.parametrize(
    ("columns", "signals"),
    [
        ({"Greifer": 500}, ["Greifer"]),
        ({"DO 1": 500, "DO 2": 700, "Gripper.closed": 900}, ["Gripper-closed"]),
        ({"DO 1": 500, "1": 700}, ["DO-1", "signal1"]),
        ({f"DO {k}": 500 + k for k in range(1, 5)}, []),
        ({"Gripper": 2500}, []),
    ],
)
def test_a_column_of_two_values_may_tell_what_is_carried(
    record: Path, columns: dict[str, int], signals: list[str]
) -> None:
    """The one of a gripper by its name, or the only few; not if it hardly changes. Values: rows between changes."""
    names, *rows = record.read_text(encoding="utf-8").splitlines()
    added = [",".join([row, *(str(k // n % 2) for n in columns.values())]) for k, row in enumerate(rows)]
    record.write_text("\n".join([",".join([names, *columns]), *added]), encoding="utf-8")
    text = shown("init", record)
    for axis in load(Path("axis.toml")).axes:
        assert [signal.name for signal in axis.config.signal] == signals
    carried = ", ".join(
        name for name in columns if re.sub(r"[ .]", "-", f"signal{name}" if name == "1" else name) in signals
    )
    assert (f"all axes: {carried} may tell what the robot carries" in text) == bool(signals)
    assert text.count(" may tell what the robot carries") == bool(signals)
    unused = [name for name in columns if re.sub(r"[ .]", "-", name) not in signals and name != "1"]
    assert not unused or f"not used: {', '.join(unused)}" in text


# --- Times ------------------------------------------------------------------------------------------------------------


def retime(record: Path, head: str, cells: Iterable[str]) -> None:
    """Write other times into the first column, ``head``."""
    names, *lines = record.read_text("utf-8").splitlines()
    rows = [",".join([cell, line.partition(",")[2]]) for cell, line in zip(cells, lines, strict=False)]
    record.write_text("\n".join([head + names[names.index(",") :], *rows]) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("head", "cell"),
    [("Time", "02.03.2026 08:00:{0.seconds:02}"), ("Time", "{0.seconds}"), ("Time [ms]", "{1}0"), ("t", "{2:.2f}")],
)
def test_rounded_times_tell_the_interval(record: Path, head: str, cell: str) -> None:
    """As spreadsheets show dates, and loggers print few digits: there are as many rows in each second."""
    times = [timedelta(milliseconds=5 * k) for k in range(4000)]
    retime(record, head, (cell.format(t, t // timedelta(milliseconds=10), t.total_seconds()) for t in times))
    assert "rows are taken as evenly spaced, 0.005 s apart" in shown("init", record)
    first, _ = proposed()
    assert (first.time.column, first.sample_interval_s) == (None, 0.005)


@pytest.mark.parametrize(
    ("head", "cell", "interval_s", "words"),
    [
        ("Time", "{0:.3f}", 0.005, ""),
        ("Time [ms]", "{1:.0f}", 0.005, ""),
        ("TimeUs", "{2:.0f}", 0.005, ""),
        ("Time", "{1:.0f}", 0.005, " if it is in ms, as its steps suggest"),
        ("Time", "{2:.0f}", 0.005, " if it is in µs, as its steps suggest"),
        ("Time", "{3:.11f}", 0.005, " if it is in days, as its steps suggest"),
        ("Time", "{4:.8f}", 0.005 / 60, " if it is in s, as its steps suggest"),
    ],
)
def test_a_unit_of_the_time_that_no_name_shows_is_asked_for(
    record: Path, head: str, cell: str, interval_s: float, words: str
) -> None:
    times = [0.005 * k for k in range(4000)]
    retime(record, head, (cell.format(t, 1e3 * t, 1e6 * t, 46083.25 + t / 86_400, t / 60) for t in times))
    assert f"time: {head}, {interval_s:.4g} s apart{words}\n" in shown("init", record)
    assert proposed()[0].sample_interval_s == pytest.approx(interval_s, rel=1e-3)


def test_dates_are_in_seconds_however_far_apart(record: Path, seed: int) -> None:
    """Of a logger with a row a second, the rows look as if they counted milliseconds."""
    late = np.random.default_rng(seed).integers(0, 30, 4000)
    retime(
        record,
        "Timestamp",
        (f"2026-03-02 {t // 3600:02}:{t // 60 % 60:02}:{t % 60:02}.{late[t]:03}" for t in range(4000)),
    )
    assert "time: Timestamp, 1 s apart\n" in shown("init", record)
    first = proposed()[0]
    assert (first.time.column, first.time.factor) == ("Timestamp", 1)
    assert first.sample_interval_s == pytest.approx(1.0, rel=0.02)


_FILETIME = 134_404_344_000_000_000


_TICKS = 639_085_896_000_000_000


@pytest.mark.parametrize(
    ("head", "cells", "factor", "words"),
    [
        ("Timestamp", (_FILETIME + 50_000 * k for k in range(4000)), 1e-7, "100 ns since 1601, as times of Windows"),
        ("t [100 ns]", (_FILETIME + 50_000 * k for k in range(4000)), 1e-7, "100 ns since 1601, as times of Windows"),
        ("Ticks", (_TICKS + 50_000 * k for k in range(4000)), 1e-7, "100 ns since the year 1, as times of .NET do"),
        ("time_100ns", (50_000 * k for k in range(4000)), 1e-7, ""),
        ("Time_ms", (46_355_583_333.3 + k * 0.005 / 0.0864 for k in range(4000)), 0.0864, "millionths of a day since"),
        ("Time_ms", (46_355_583_335 + 5 * k for k in range(4000)), 1e-3, ""),  # a machine that runs for 537 days
        ("Time", (1_795_960_800_000_000_000 + 5_000_000 * k for k in range(4000)), 1e-9, "it is in ns, as its steps"),
    ],
)
def test_times_that_count_other_steps_than_their_name_says(
    record: Path, head: str, cells: Iterable[float], factor: float, words: str
) -> None:
    """Their size shows it: a ten times longer interval would be a hundred times the inertia."""
    retime(record, head, (f"{cell:.4f}" if isinstance(cell, float) else str(cell) for cell in cells))
    text = shown("init", record)
    found = proposed()[0]
    assert found.time.factor == pytest.approx(factor)
    assert found.sample_interval_s == pytest.approx(0.005, rel=2e-3)
    assert (
        (f" s apart if it counts {words}" in text or f" s apart if {words}" in text)
        if words
        else " apart if" not in text
    )


def test_seconds_and_their_fraction_in_two_columns(record: Path) -> None:
    """As ROS writes them: the rows are evenly spaced, and it is shown how to write the times of lost ones."""
    names, *lines = record.read_text("utf-8").splitlines()
    stamps = (f"{1_795_960_800 + k // 200},{k % 200 * 5_000_000}" for k in range(4000))
    rows = [",".join([stamp, line.partition(",")[2]]) for stamp, line in zip(stamps, lines, strict=False)]
    head = "stamp.sec,stamp.nanosec" + names[names.index(",") :]
    record.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert "rows are taken as evenly spaced, 0.005 s apart" in text
    assert (
        'it is the fraction of "stamp.sec"; where rows are missing, write both as one column, stamp.sec + 1e-9' in text
    )
    assert [(axis.time.column, axis.sample_interval_s) for axis in proposed()] == [(None, 0.005)] * 2


@pytest.mark.parametrize(("head", "cell"), [("Time", "{0:.3f}"), ("stamp.nanosec", "{1}")])
def test_a_time_that_starts_again_is_not_the_time(record: Path, head: str, cell: str) -> None:
    """A recorder began a second time, or seconds are in another column."""
    retime(record, head, (cell.format(0.005 * (k % 3500), k % 200 * 5_000_000) for k in range(4000)))
    text = shown("init", record)
    assert "time: no column; rows are taken as evenly spaced, 0.005 s apart" in text
    assert f'; "{head}" starts again: where rows are missing there, cut the file\n' in text
    assert [axis.time.column for axis in proposed()] == [None, None]


@pytest.mark.parametrize(("rate", "columns"), [(1.0, 2), (0.8, 1)])
def test_signals_with_times_of_their_own(record: Path, rate: float, columns: int) -> None:
    """The scope of TwinCAT writes a time column for each signal: at another rate it belongs to other rows."""
    lines = record.read_text("utf-8").splitlines()
    cells = [line.split(",") for line in lines[1:]]
    rows = [",".join([t, u, t, y, f"{rate * float(t)}", *rest]) for t, u, y, *rest in cells]
    record.write_text("\n".join(["Name,A1_Trq,Name,A1_Pos,Name,A2_Trq,A2_Pos", *rows]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert len(proposed()) == columns
    apart = "not used: at other times than the others: A2_Trq, A2_Pos; export all at one rate"
    assert (apart in text) == (columns == 1)


@pytest.mark.parametrize(
    ("times", "words"),
    [("{:.0f}", "time: Time"), ("03/02/2026 08:00:{:.0f}", "write a date as 2026-03-02 08:00:00.005")],
)
def test_times_that_are_no_seconds(record: Path, times: str, words: str) -> None:
    """In nanoseconds since 1970; in a way that is not read, which must not go unsaid."""
    lines = record.read_text(encoding="utf-8").splitlines()
    cells = [line.split(",", 1) for line in lines[1:]]
    text = [f"{times.format(1.77e18 + 5e6 * k)},{rest}" for k, (_, rest) in enumerate(cells)]
    record.write_text("\n".join([lines[0], *text]) + "\n", encoding="utf-8")
    assert words in shown("init", record)
    first, _ = proposed()
    assert first.time.column is None or (first.time.factor, first.sample_interval_s) == (1e-9, 0.005)


def test_torque_and_motion_in_rows_of_their_own(record: Path) -> None:
    """As two subscriptions of OPC UA are joined: the proposal, and a record of what was proposed before."""
    shown("init", record)
    head, *rows = record.read_text(encoding="utf-8").splitlines()
    cells = (row.split(",") for row in rows)
    apart = [row for t, u, y, *_ in cells for row in (f"{float(t)},{u},,,", f"{float(t) + 0.002},,{y},,")]
    record.write_text("\n".join([head, *apart]) + "\n", encoding="utf-8")
    text = refused("init", record, "--force")
    assert "A1_Trq and A1_Pos are hardly ever in the same row" in text
    assert "export all columns with a common interval" in text
    text = refused("identify", record, "--config", "axis.toml", "--axis", "axis1")
    assert "0 samples of axis robot1.axis1 in it; dropped: " in text
    assert "as no two rows have both torque and angle: export them with a common interval" in text


def test_rows_in_which_a_few_values_lack_are_no_rows_of_their_own(record: Path) -> None:
    """As values that are written only when they change: one of five rows has both."""
    head, *rows = record.read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    gaps = [[t, u, y if k % 5 == 0 else "", *rest] for k, (t, u, y, *rest) in enumerate(cells)]
    record.write_text("\n".join([head, *map(",".join, gaps)]) + "\n", encoding="utf-8")
    text = shown("init", record)
    assert "axis1: torque A1_Trq, angle A1_Pos" in text
    assert "common interval" not in text


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


# --- Files ------------------------------------------------------------------------------------------------------------


def test_a_cell_that_holds_no_number_does_not_cost_its_column(record: Path) -> None:
    lines = record.read_text(encoding="utf-8").splitlines()
    for row, column in ((300, 1), (500, 2)):
        cells = lines[row].split(",")
        lines[row] = ",".join([*cells[:column], "none", *cells[column + 1 :]])
    record.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert "axis1: torque A1_Trq, angle A1_Pos: sure" in shown("init", record)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("names", ["t,torque_1,angle_1,angle_cmd,q_1\n", "#\n"])
@pytest.mark.parametrize("rows", range(1, 8))
def test_hardly_any_rows(names: str, rows: int) -> None:
    """They give an axis or are refused with the reason."""
    cells = [f"{0.004 * k:.3f},{k % 3},{-k * k},FALSE,{k * k}\n" for k in range(rows)]
    Path("a.csv").write_text(names + "".join(cells), encoding="utf-8")
    result = axiswatch("init", "a.csv")
    assert (result.exit_code, "torque and motion" in result.stderr) in ((0, False), (2, True))


@pytest.mark.usefixtures("record")
def test_mistakes() -> None:
    Path("still.csv").write_text("t,u,y\n" + "".join(f"{k},0,1\n" for k in range(9)), encoding="utf-8")
    Path("names.csv").write_text("t,u,y\ns,Nm,rad\n", encoding="utf-8")
    text = session("init", "record.csv -o record.csv", "frames.log", "missing.csv", "still.csv", "names.csv")
    golden.check(text, Path(__file__).parent / "golden" / "init_mistakes.txt")


@pytest.mark.parametrize(
    ("head", "line", "names"),
    [
        ("time,axis,torque,angle", "{0:.3f},A{1},{2},{3}\n", ("torque_A", "angle_A")),
        ("time,name,value", "{0:.3f},torque{1},{2}\n{0:.3f},angle{1},{3}\n", ("torque", "angle")),
    ],
)
def test_a_table_with_a_row_for_each_axis_or_signal(record: Path, head: str, line: str, names: tuple[str, str]) -> None:
    rows = read_rows(record)
    lines = [line.format(row[0], k, row[2 * k - 1], row[2 * k]) for row in rows for k in (1, 2)]
    record.write_text(f"{head}\n" + "".join(lines), encoding="utf-8")
    text = shown("init", record)
    for k in (1, 2):
        assert f"axis{k}: torque {names[0]}{k}, angle {names[1]}{k}: sure" in text
