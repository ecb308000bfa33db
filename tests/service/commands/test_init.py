"""``axiswatch init``: columns become axes, by their names; and files that it reads."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from service.config import load
from tests import golden
from tests.service.command_line import axiswatch, session, shown
from tests.service.commands.commissioning.two_mass_tables import read_rows, write_rows
from tests.service.commands.proposals import proposed, rename_columns


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
