"""``axiswatch init`` from a description of a bus: units and names tell what its signals are; `check` accepts it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from service.config import load
from service.config.schema import NamedAxis
from tests.conftest import ROOT
from tests.service import canopen_files
from tests.service.command_line import refused, shown
from tests.service.commands import can_logs
from tests.service.drive_descriptions import TEXTS

MORE = """
BO_ 700 Joint1_Set: 8 Monitor
 SG_ Joint1_Torque_Set : 0|16@1- (0.001,0) [-32|32] "Nm" Controller
BO_ 701 Joint1_Limits: 8 Monitor
 SG_ Joint1_Pos_Max : 0|16@1- (0.001,0) [-32|32] "rad" Controller
BO_ 702 Drive3: 8 Controller
 SG_ M_Torque : 0|16@1- (1,0) [-1000|1000] "permille" Monitor
 SG_ M_Speed : 16|16@1- (1,0) [-6000|6000] "rpm" Monitor
 SG_ M_Temp : 32|16@1- (0.1,0) [-40|200] "degC" Monitor
 SG_ M_Alive : 48|8@1+ (1,0) [0|255] "" Monitor

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 702 10;
"""


pytestmark = pytest.mark.usefixtures("folder")


def proposed(dbc: Path) -> tuple[str, tuple[NamedAxis, ...]]:
    """What ``init`` prints, and the axes; ``check`` accepts them."""
    output = shown("init", dbc)
    assert "no problems" in shown("check", "--config", "axis.toml")
    return output, load(Path("axis.toml"), {}).axes


def test_units_and_names(folder: Path) -> None:
    text, axes = proposed(can_logs.dbc(folder / "robot.dbc", 2, "deg", MORE))
    assert "axis1: torque Joint1.Joint1_Torque_Act [Nm], angle Joint1.Joint1_Pos_Act [deg]: sure" in text
    assert "Next: axiswatch commission RECORD.log --config axis.toml" in text
    assert [axis.id for axis in axes] == ["robot1.axis1", "robot1.axis2", "robot1.axis3"]
    assert axes[0].config.motion.factor == pytest.approx(math.pi / 180)
    drive = axes[2].config
    assert (drive.torque.signal, drive.motion.signal, drive.output) == ("M_Torque", "M_Speed", "speed")
    assert drive.motion.factor == pytest.approx(math.pi / 30)
    assert drive.sample_interval_s == 0.01
    assert drive.time.counter_signal == "M_Alive"
    written = Path("axis.toml").read_text(encoding="utf-8")
    assert "# sure: in per mille of the rated torque; factor is rated torque / 1000 [N m]" in written


@pytest.mark.parametrize(("name", "count"), [("demo.dbc", 6), ("robot.dbc", 6), ("irb.dbc", 1)])
def test_shipped_files(name: str, count: int) -> None:
    output, axes = proposed(ROOT / "config" / name)
    assert len(axes) == count
    assert output.count(": sure") == count
    written = Path("axis.toml").read_text(encoding="utf-8")
    assert len(written.splitlines()) <= 60
    assert [written.count(key) for key in ("sample_interval_s = ", "model = ", "[[robot.axis]]")] == [
        1,
        1,
        count,
    ]


def cycle_times(ms: dict[int, int]) -> str:
    """The end of a DBC with the cycle times of messages by their ids."""
    head = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    return head + "".join(f'BA_ "GenMsgCycleTime" BO_ {number} {time};\n' for number, time in ms.items())


def test_a_gripper_and_a_payload(folder: Path) -> None:
    """A message without a cycle may be sent only when something changes, so its values do not become too old."""
    more = 'BO_ 704 Scale: 8 Controller\n SG_ Payload : 8|16@1+ (0.1,0) [0|100] "kg" Monitor\n'
    more += 'BO_ 703 Outputs: 8 Controller\n SG_ DO_Gripper : 0|1@1+ (1,0) [0|1] "" Monitor\n'
    more += ' SG_ GripperCounter : 24|8@1+ (1,0) [0|255] "" M\n SG_ GripperForce : 32|16@1+ (1,0) [0|9] "N" M\n'
    more += 'BO_ 705 Second: 8 Controller\n SG_ DO_Gripper : 0|1@1+ (1,0) [0|1] "" M\n\n'
    more += cycle_times({704: 100})
    text, axes = proposed(can_logs.dbc(folder / "robot.dbc", 2, "deg", more))
    assert "all axes: Scale.Payload, Outputs.DO_Gripper, Second.DO_Gripper may tell what the robot carries" in text
    for axis in axes:
        found = {(signal.name, signal.message, signal.signal, signal.max_age_s) for signal in axis.config.signal}
        assert found == {
            ("Outputs-DO_Gripper", "Outputs", "DO_Gripper", 3600.0),
            ("Second-DO_Gripper", "Second", "DO_Gripper", 3600.0),
            ("Payload", "Scale", "Payload", 10.0),
        }


def test_the_temperature_of_each_axis(folder: Path) -> None:
    """That of the gear rather than that of the motor or of a board; a flag and a limit are none."""
    more = 'BO_ 704 Temps1: 8 Drive\n SG_ MotorTemp1 : 0|16@1+ (0.1,0) [0|200] "degC" M\n'
    more += ' SG_ GearTemp1 : 16|16@1+ (0.1,0) [0|200] "degC" M\n SG_ TempLimit1 : 32|16@1+ (1,0) [0|9] "degC" M\n'
    more += 'BO_ 705 Temps2: 8 Drive\n SG_ BoardTemp2 : 0|16@1+ (0.1,0) [0|200] "degC" M\n'
    more += ' SG_ Motor2 : 16|16@1+ (0.1,0) [0|200] "degC" M\n SG_ GearOverTemp2 : 48|1@1+ (1,0) [0|1] "" M\n\n'
    more += cycle_times({704: 1000, 705: 10_000})
    text, axes = proposed(can_logs.dbc(folder / "robot.dbc", 2, "deg", more))
    assert "temperatures, which friction may follow: axis1: Temps1.GearTemp1, axis2: Temps2.Motor2" in text
    found = [(s.name, s.message, s.signal, s.max_age_s) for axis in axes for s in axis.config.signal]
    assert found == [
        ("temperature", "Temps1", "GearTemp1", 10.0),
        ("temperature", "Temps2", "Motor2", 3600.0),  # every ten seconds, so the last value is of use for longer
    ]


def test_many_outputs_of_grippers_are_one_line_for_people_and_one_each_in_the_file(folder: Path) -> None:
    signals = "".join(f' SG_ Gripper{k} : {k}|1@1+ (1,0) [0|1] "" M\n' for k in range(40))
    text, axes = proposed(can_logs.dbc(folder / "robot.dbc", 2, "deg", f"BO_ 703 Outputs: 8 Controller\n{signals}\n"))
    (line,) = [line for line in text.splitlines() if "may tell what the robot carries" in line]
    assert "Outputs.Gripper0, Outputs.Gripper1, " in line
    assert "and 28 more" in line
    assert [len(axis.config.signal) for axis in axes] == [40, 40]
    written = Path("axis.toml").read_text(encoding="utf-8").splitlines()
    assert sum('signal = "Gripper' in line for line in written) == 40
    assert max(map(len, written)) < 200


def test_a_real_one(records_dir: Path) -> None:
    """Drives that send currents and revolutions; what they are sent is no measurement."""
    _, axes = proposed(records_dir / "can" / "odrive-cansimple.dbc")
    assert len(axes) == 8
    first = axes[0].config
    assert (first.torque.message, first.torque.signal) == ("Axis0_Get_Iq", "Iq_Measured")
    assert first.motion.signal == "Pos_Estimate"
    assert first.motion.factor == pytest.approx(2 * math.pi)
    assert "a current: add kT_Nm_per_A" in Path("axis.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", TEXTS)
def test_other_formats(name: str, folder: Path) -> None:
    """The same drive in each of them gives the same axis."""
    (folder / name).write_text(TEXTS[name](), encoding="utf-8")
    _, (axis,) = proposed(folder / name)
    torque, motion = axis.config.torque, axis.config.motion
    assert (torque.message, torque.signal, torque.factor) == ("Drive", "Torque", 1)
    assert (motion.message, motion.signal, axis.config.output) == ("Motion", "Angle", "angle")


def test_canopen_drives(folder: Path) -> None:
    """Of what the drive does not say, there are lines to be filled in."""
    eds = folder / "drive.eds"
    eds.write_text(canopen_files.eds(), encoding="utf-8")
    assert "say which drives: --node 3 --node 4, --bus, or a log" in refused("init", eds)
    log = folder / "a.log"
    log.write_text("(1.0) can0 080#\n(1.001) can0 183#0000\n(1.001) can1 184#0000\n(1.002) can1 185#0000\n", "utf-8")
    text = shown("init", eds, log)
    assert [line[:7] for line in text.splitlines() if line.startswith("node ")] == ["node 4:", "node 5:"]
    log.write_text("(1.0) can0 701#05\n", "utf-8")
    assert "a.log: 1 frames; is the master on" in refused("init", eds, log, "--force")
    Path("axis.toml").unlink()
    torque, motion, _ = canopen_files.TWO_PDOS
    pdos = (torque._replace(objects=["60780010"]), motion._replace(objects=["606C0020"]))
    eds.write_text(canopen_files.eds(pdos), encoding="utf-8")
    assert "node 7: current 0x6078, velocity 0x606C" in shown("init", eds, "--node", 7)
    text = re.sub(r"\n#(?!side)(?=\w)", "\n", Path("axis.toml").read_text(encoding="utf-8"))
    Path("axis.toml").write_text(text[text.index("[[bus]]") :], encoding="utf-8")
    assert "no problems" in shown("check", "--config", "axis.toml")
    (axis,) = load(Path("axis.toml"), {}).axes
    assert (axis.config.torque.signal, axis.config.motion.signal, axis.config.output) == (
        "0x6078",
        "0x606C",
        "speed",
    )
    eds.write_text(canopen_files.eds((motion,)), encoding="utf-8")
    words = refused("init", eds, "--node", 7, "--force")
    assert "node7 does not send 0x6077 (torque actual value): no transmit PDO holds it in drive.eds" in words


def test_a_dcf_says_which_node_it_is_of_and_what_is_rated(folder: Path) -> None:
    """With the line ends and letters of the tools that write such files."""
    position = "counts_per_turn"
    text = canopen_files.eds() + canopen_files.settings(node=5, rated={"6076": 1270}, encoder=(8192, 2))
    dcf = folder / "drive.dcf"
    dcf.write_bytes(text.replace("torque_actual_value", "Drehmoment f\u00fcr Achse").encode("cp1252"))
    dcf.write_bytes(dcf.read_bytes().replace(b"\n", b"\r\n"))
    assert "node 5: torque 0x6077, position 0x6064" in shown("init", dcf)
    proposed = Path("axis.toml").read_text(encoding="utf-8")
    for words in (
        "#rated_torque_Nm = 1.27 ",
        f"#{position} = 4096 ",
        "node_id = 5",
        "0x2031 (motor_voltage)",
    ):
        assert words in proposed
    assert f"{position}: missing" in refused("check", "--config", "axis.toml")  # it is not guessed


def test_no_axis_in_it(folder: Path) -> None:
    path = folder / "none.dbc"
    path.write_text('VERSION ""\n\nBU_: A\n\nBO_ 5 M: 8 A\n SG_ Temp : 0|8@1+ (1,0) [0|0] "degC" A\n', "utf-8")
    assert "no torque and motion of an axis in none.dbc" in refused("init", "none.dbc")
