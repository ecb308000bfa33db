"""``axiswatch init --bus``: what a bus sends decides which of its signals are torque and motion."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from monitor_core.arrays import Floats
from service.commands.command_line.exit_codes import NO_BUS
from service.config import load
from service.ingest.records.axis_records import silent_in
from tests.service.command_line import axiswatch, refused, shown
from tests.service.commands import can_logs
from tests.service.commands.commissioning.two_mass_tables import table
from tests.service.commands.live_robots import configured, moving

MORE = """
BO_ 902 Io: 8 Controller
 SG_ Voltage : 0|16@1+ (0.1,0) [0|0] "V" Monitor
"""


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory, seed: int) -> Path:
    return table(tmp_path_factory.mktemp("rows") / "rows.csv", seed, 16.0, axes=2)


def bus_of(config: Path) -> str:
    bus = load(config, {}).bus[0]
    return f"{bus.interface}:{bus.channel},preserve_timestamps=true"


def wrong(rows: Floats) -> None:
    """The first torque has the wrong sign, the second axis stands; angles in degrees that start again at 360."""
    rows[:, 1] *= -1
    rows[:, 2] = 180 / math.pi * rows[:, 2] % 360
    rows[:, 3:] = 0.5


@pytest.mark.parametrize("kind", [".log", ".asc"])
def test_a_log_in_place_of_a_bus(kind: str, folder: Path, rows: Path) -> None:
    """The log is then commissioned with what was written."""
    described = can_logs.dbc(folder / "robot.dbc", 2, "deg", MORE)
    config = can_logs.configured(folder / "robot.toml", described, 2)
    log = can_logs.log_of(rows, config, folder / f"healthy{kind}")
    text = shown("init", "robot.dbc", log.name)
    assert "axis2: torque Joint2.Joint2_Torque_Act [Nm], angle Joint2.Joint2_Pos_Act [deg]: sure (as one" in text
    assert "not received: Io (0x386)" in text
    assert f"Next: axiswatch commission {log.name} --config axis.toml" in text
    assert "no problems" in shown("check", "--config", "axis.toml")
    assert [axis.config.sample_interval_s for axis in load(Path("axis.toml"), {}).axes] == [0.005, 0.005]
    assert set(silent_in(log, load(Path("axis.toml"), {}))) == set()


@pytest.mark.parametrize(
    ("sent", "logged", "words"),
    [
        ("can0 182#", "can1 182#", "looked at: can0; can1 carries Joint2: each channel needs a [[bus]]\n"),
        ("can0 182#", "can1 181#", "looked at: can0; can1 carries Joint1: each channel needs a [[bus]]\n"),
        ("can0 182#", "can1 7FF#", "not received: Joint2 (0x182)\nNext"),
        (" 181#", " 00000181#", "not in robot.dbc: 0x181 (received with 29 bits, described with 11)\n"),
    ],
)
def test_messages_on_another_channel_or_of_another_kind(
    sent: str, logged: str, words: str, folder: Path, rows: Path
) -> None:
    described = can_logs.dbc(folder / "robot.dbc", 2)
    log = can_logs.log_of(rows, can_logs.configured(folder / "robot.toml", described, 2), folder / "a.log")
    log.write_text(log.read_text("utf-8").replace(sent, logged), encoding="utf-8")
    assert words in shown("init", "robot.dbc", "a.log")


def test_what_no_log_is_looked_at_with(folder: Path, rows: Path) -> None:
    can_logs.dbc(folder / "robot.dbc")
    (folder / "empty.log").write_text("", encoding="utf-8")
    assert "no CAN frames in it" in refused("init", "robot.dbc", "empty.log")
    for given in (("robot.dbc", rows), (rows, "empty.log"), ("robot.dbc", "empty.log", "--bus", "virtual:a")):
        assert "axiswatch init robot.dbc robot.log" in refused("init", *given)
    assert "one table is looked at" in refused("init", rows, rows)


def test_signs_wraps_intervals_and_what_never_came(folder: Path, rows: Path) -> None:
    config = configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 2, "deg", MORE), 2)
    with moving(rows, config, wrong):
        text = shown("init", "robot.dbc", "--bus", bus_of(config), "--seconds", 1)
    assert "axis1: torque Joint1.Joint1_Torque_Act [Nm], angle Joint1.Joint1_Pos_Act [deg]: sure (as one" in text
    assert "axis2: torque Joint2.Joint2_Torque_Act [Nm], angle" in text
    assert "sure by its name; it did not move" in text
    assert "not received: Io (0x386)" in text
    assert "Next: axiswatch commission --config axis.toml --minutes 10" in text
    assert "no problems" in shown("check", "--config", "axis.toml")
    read = load(Path("axis.toml"), {})
    first, second = (axis.config for axis in read.axes)
    assert (read.bus[0].interface, read.bus[0].channel) == ("virtual", load(config, {}).bus[0].channel)
    assert read.bus[0].options == {"preserve_timestamps": True}
    assert first.torque.factor == -1
    assert first.angle is not None
    assert first.angle.factor == pytest.approx(math.pi / 180)
    assert first.angle.wrap_period == 360
    assert second.torque.factor == 1
    assert (first.sample_interval_s, second.sample_interval_s) == (0.005, 0.005)


@pytest.mark.vcan
def test_on_a_real_device(folder: Path, seed: int) -> None:
    """The robot moves for a minute: the command may be slow to begin."""
    rows = table(folder / "rows.csv", seed, 60.0, axes=2)
    config = configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 2, "deg", MORE), 2, "vcan0")
    with moving(rows, config, wrong):
        text = shown("init", "robot.dbc", "--bus", "socketcan:vcan0", "--seconds", 6)
    assert "axis1: torque Joint1.Joint1_Torque_Act [Nm], angle Joint1.Joint1_Pos_Act [deg]: sure" in text
    assert "not received: Io (0x386)" in text
    first, second = (axis.config for axis in load(Path("axis.toml"), {}).axes)
    assert (first.bus, first.torque.factor, second.torque.factor) == ("vcan0", -1, 1)
    assert first.sample_interval_s == pytest.approx(0.005, rel=0.01)
    assert first.time.clock == "cyclic", "the robot of this test sends in bunches"


def test_names_that_say_nothing(folder: Path, rows: Path) -> None:
    """Two signals without units: the torque explains the motion."""
    dbc = can_logs.dbc(folder / "robot.dbc", 1, "rad")
    config = configured(folder / "robot.toml", dbc)
    text = dbc.read_text(encoding="utf-8").replace('"Nm"', '""').replace('"rad"', '""')
    for old, new in (("Joint1_Torque_Act", "X1"), ("Joint1_Pos_Act", "X2"), ("Joint1", "M1")):
        text = text.replace(old, new)
    (folder / "opaque.dbc").write_text(text, encoding="utf-8")
    assert "no torque and motion of an axis" in refused("init", "opaque.dbc")
    with moving(rows, config):
        found = shown("init", "opaque.dbc", "--bus", bus_of(config), "--seconds", 1)
    assert "axis1: torque M1.X1, angle M1.X2: sure" in found


def test_what_is_refused(folder: Path, rows: Path) -> None:
    config = configured(folder / "robot.toml", can_logs.dbc(folder / "robot.dbc", 1))
    bus = bus_of(config)
    assert "must be INTERFACE:CHANNEL, such as socketcan:can0" in refused("init", "robot.dbc", "--bus", "can0")
    assert 'did you mean "socketcan"?' in refused("init", "robot.dbc", "--bus", "socketcna:can0")
    assert "rows.csv describes no bus" in refused("init", rows, "--bus", bus)
    silent = axiswatch("init", "robot.dbc", "--bus", bus, "--seconds", 1)
    assert "is silent: no frame in 1 s" in silent.stderr
    gone = axiswatch("init", "robot.dbc", "--bus", "socketcan:can77", "--seconds", 1)
    assert (gone.exit_code, "there is no network interface can77" in gone.stderr) == (NO_BUS, True)
    other = (folder / "robot.dbc").read_text(encoding="utf-8").replace("BO_ 38", "BO_ 48")
    (folder / "other.dbc").write_text(other, encoding="utf-8")
    with moving(rows, config):
        strange = axiswatch("init", "other.dbc", "--bus", bus, "--seconds", 1)
    assert "none of their messages is in other.dbc: 0x181; does that describe this robot" in strange.stderr
    assert not Path("axis.toml").exists()
