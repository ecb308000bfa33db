"""``discover`` on buses that nothing describes: the axes of simulated robots, and a real bus where nothing moves."""

import gzip
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
import pytest

from monitor_core.arrays import Floats
from service.can.frame_recorder import FrameRecorder
from service.can.frames import Frame, FrameBlock, concatenate_frames
from service.can.messages import message_of
from service.commands.command_line.exit_codes import MISTAKE
from service.config import Config, load
from service.ingest.roles.signal_roles import summary
from service.ingest.roles.unknown_messages import discover_axes
from tests.conftest import ROOT
from tests.service.command_line import axiswatch, refused, shown
from tests.service.pipeline.robots import DEMO, blocks, demo


def log_of(config: Config, path: Path, seed: int, seconds: float = 8.0) -> Path:
    with FrameRecorder(path) as recorder:
        for block in blocks(config, seconds, seed):
            recorder.write("can0", block)
    return path


def separate_messages(folder: Path, axes: int) -> Config:
    """The same robot with torques and angles in messages of their own, a speed beside each angle."""
    text = DEMO.read_text(encoding="utf-8").replace("demo.dbc", str(ROOT / "config" / "robot.dbc"))
    text = text.partition(f'[[robot.axis]]\nname = "axis{axes + 1}"')[0]
    for what, message in (("torque", "Torque"), ("angle", "Angle")):
        text = re.sub(rf'({what} = .*"Axis\d)State"', rf'\1{message}"', text)
    file = folder / "robot.toml"
    file.write_text(text, encoding="utf-8")
    return load(file, {})


def test_all_axes_of_the_demo_are_found_by_the_frames_alone(tmp_path: Path, seed: int) -> None:
    frames = concatenate_frames(list(blocks(demo(tmp_path, 4), 8.0, seed)))
    found = discover_axes(frames).axes
    assert [axis.name for axis in found] == [f"axis{k}" for k in range(1, 5)]
    for number, axis in enumerate(found, 1):
        assert (axis.torque.message, axis.torque.signal) == (f"x18{number}", "value_a")
        assert (axis.motion.message, axis.motion.signal) == (f"x18{number}", "value_c")
        assert (axis.motion.quantity, axis.torque.turned, axis.interval_s) == ("angle", False, 0.005)
        assert axis.counter == (f"x18{number}", "counter_g")


def test_identifiers_of_29_bits(tmp_path: Path, seed: int) -> None:
    """As of J1939, whose own messages of a maker have FF in them."""
    frames = concatenate_frames(list(blocks(demo(tmp_path, 1), 8.0, seed)))
    own = [frame._replace(can_id=0x18FF3101, extended=True) for frame in frames.frames()]
    (axis,) = discover_axes(FrameBlock.from_frames(own)).axes
    assert (axis.torque.message, axis.torque.signal, axis.motion.signal) == (
        "x18ff3101",
        "value_a",
        "value_c",
    )


def test_the_bits_of_the_configuration_are_those_that_were_looked_at(seed: int) -> None:
    """Big-endian, after a byte that never changes: decoded by its description, the number is the same."""
    rng = np.random.default_rng(seed)
    numbers = np.rint(2e7 * np.sin(np.arange(500) / 40) + 100 * rng.standard_normal(500)).astype(int).tolist()
    frames = FrameBlock.from_frames(
        [Frame(5000 * k, 0x321, False, b"\x07" + n.to_bytes(4, "big", signed=True)) for k, n in enumerate(numbers)]
    )
    (message,) = discover_axes(frames).messages
    (bits,) = message.bits
    assert (bits.start_bit, bits.length, bits.kind, bits.byte_order) == (15, 32, "signed", "big")
    described = message_of(message.name, message.key, message.bits)
    assert [described.decode_simple(frame.data)[bits.name] for frame in frames.frames()] == numbers


@pytest.mark.parametrize("order", ["little", "big"])
def test_the_bits_of_numbers_that_are_no_whole_bytes(order: Literal["little", "big"], seed: int) -> None:
    """A state of four bits, and numbers of 12 and 24: decoded by the description they are the same."""
    rng, t = np.random.default_rng(seed), np.arange(500) / 40
    noise = rng.standard_normal((2, 500))
    small = np.rint(1500 * np.sin(2 * t) + 3 * noise[0]).astype(int).tolist()
    large = np.rint(5e6 * np.sin(t) + 30 * noise[1]).astype(int).tolist()
    places = (0, 4, 16) if order == "little" else (36, 24, 0)
    values = [(k // 200, a % 2**12, b % 2**24) for k, (a, b) in enumerate(zip(small, large, strict=True))]
    words = [sum(v << place for v, place in zip(row, places, strict=True)) for row in values]
    frames = [Frame(5000 * k, 0x321, False, word.to_bytes(5, order)) for k, word in enumerate(words)]
    (message,) = discover_axes(FrameBlock.from_frames(frames)).messages
    described = message_of(message.name, message.key, message.bits)
    decoded = [list(described.decode_simple(frame.data).values()) for frame in frames]
    assert decoded == [list(row) for row in zip(small, large, strict=True)]


def test_a_counter_of_four_bits_times_the_axis(tmp_path: Path, seed: int) -> None:
    """Beside other bits in its byte; read as a byte it would count sixteen times too many."""
    frames = concatenate_frames(list(blocks(demo(tmp_path, 1), 8.0, seed)))
    frames.records["data"][:, 6] = frames.records["data"][:, 6] & 0xF | 0x50
    frames.records["data"][:, 7] = 0x11
    (axis,) = discover_axes(frames).axes
    assert (axis.interval_s, axis.counter) == (0.005, ("x181", "counter_g"))


def test_torque_and_angle_in_messages_of_their_own(tmp_path: Path, seed: int) -> None:
    frames = concatenate_frames(list(blocks(separate_messages(tmp_path, 3), 8.0, seed)))
    found = discover_axes(frames).axes
    ids = [(axis.torque.message, axis.motion.message, axis.motion.signal) for axis in found]
    assert ids == [("x101", "x201", "value_a"), ("x102", "x202", "value_a"), ("x103", "x203", "value_a")]


RATE = 250
"""Frames a second of each identifier below"""


def moving_axes(seed: int, count: int) -> list[tuple[Floats, Floats, Floats]]:
    """Angle [rad], speed [rad/s] and torque [N m] of axes that start and stop together, 16 s."""
    rng, moves, found = np.random.default_rng(seed), 20, list[tuple[Floats, Floats, Floats]]()
    pulse = np.diff(np.sin(np.pi * np.arange(101) / 100) ** 2)  # speeds up and down again
    for _ in range(count):
        speeds = rng.choice([-1, 1], moves) * rng.uniform(5, 20, moves)
        acceleration = np.repeat(speeds, 200) * np.tile(np.concatenate([pulse, np.zeros(100)]), moves) * RATE
        speed = np.cumsum(acceleration) / RATE
        noise = 0.02 * rng.standard_normal(speed.size)
        torque = 0.01 * acceleration + 0.02 * speed + 0.2 * np.tanh(speed) + noise
        found.append((np.cumsum(speed) / RATE, speed, torque))
    return found


def counted(values: Floats, scale: float, width: int) -> list[bytes]:
    return [int(v).to_bytes(width, "little", signed=True) for v in np.rint(values * scale)]


def received(sent: Mapping[int, Sequence[bytes]], each: Mapping[int, int] = MappingProxyType({})) -> FrameBlock:
    """The frames of these identifiers, one after another in each cycle; ``each``: only in every n-th cycle."""
    frames = [
        Frame(1_000_000 + 4000 * k + 50 * place, can_id, False, data)
        for place, (can_id, column) in enumerate(sent.items())
        for k, data in enumerate(column)
        if k % each.get(can_id, 1) == 0
    ]
    return FrameBlock.from_frames(sorted(frames, key=lambda frame: frame.t_us))


def found_in(frames: FrameBlock) -> dict[str, tuple[str, str]]:
    axes = discover_axes(frames).axes
    return {axis.torque.message: (axis.motion.message, axis.motion.quantity) for axis in axes}


def test_what_a_controller_asks_for_is_no_motion_and_identifiers_number_no_axes(seed: int) -> None:
    """Each angle that is asked for comes four cycles before the measured one; torques and angles of one axis have
    unlike digits."""
    sent = dict[int, list[bytes]]()
    for axis, (angle, _, torque) in enumerate(moving_axes(seed, 3)):
        sent[0x91 + axis] = counted(angle[4:], 4000, 4)
        sent[0xA1 + axis] = counted(torque[:-4], 1000, 2)
        sent[0xB3 - axis] = counted(angle[:-4], 4000, 4)
    assert found_in(received(sent)) == {
        "xa1": ("xb3", "angle"),
        "xa2": ("xb2", "angle"),
        "xa3": ("xb1", "angle"),
    }


def test_a_speed_alone_and_a_torque_of_few_bits(seed: int) -> None:
    sent = dict[int, list[bytes]]()
    for axis, (_, speed, torque) in enumerate(moving_axes(seed, 3)):
        sent[0x210 + axis] = counted(speed, 100, 2)
        sent[0x32 - axis] = counted(torque, 20, 1)
    assert found_in(received(sent)) == {
        "x32": ("x210", "speed"),
        "x31": ("x211", "speed"),
        "x30": ("x212", "speed"),
    }


def test_all_axes_in_one_long_frame(seed: int) -> None:
    """Of CAN FD: a number that begins with the ninth byte is called neither i, which is a current, nor t or w."""
    axes = moving_axes(seed, 6)
    columns = [column for angle, _, torque in axes for column in (counted(torque, 1000, 2), counted(angle, 1e4, 4))]
    found = discover_axes(received({0x20: [b"".join(row) for row in zip(*columns, strict=True)]})).axes
    places = ["a", "g", "xbe", "xcc", "xda", "xdg"]
    assert [axis.torque.signal for axis in found] == [f"value_{place}" for place in places]
    assert [axis.motion.signal for axis in found] == [f"value_{p}" for p in ("c", "xba", "xbg", "xce", "xdc", "xea")]


def test_angles_at_half_the_rate_of_the_torques(seed: int) -> None:
    sent, each = dict[int, list[bytes]](), dict[int, int]()
    for axis, (angle, _, torque) in enumerate(moving_axes(seed, 3)):
        sent[0x52 - axis], sent[0x210 + axis] = counted(torque, 1000, 2), counted(angle, 1e4, 4)
        each[0x210 + axis] = 2
    frames = received(sent, each)
    assert found_in(frames) == {"x52": ("x210", "angle"), "x51": ("x211", "angle"), "x50": ("x212", "angle")}
    axes = discover_axes(frames).axes
    assert {axis.interval_s for axis in axes} == {0.008}
    assert all("come at different rates" in line for line in summary(axes))


def test_a_clock_that_was_set_back(seed: int) -> None:
    """By five seconds, in the middle of the record."""
    ((angle, _, torque),) = moving_axes(seed, 1)
    frames = received({0x50: counted(torque, 1000, 2), 0x210: counted(angle, 1e4, 4)})
    frames.records["t_us"][frames.size // 2 :] -= 5_000_000
    assert found_in(frames) == {"x50": ("x210", "angle")}


def test_the_configuration_can_be_used_with_the_record(folder: Path, seed: int) -> None:
    log = log_of(demo(folder, 1), folder / "unknown.log", seed)
    text = shown("discover", log.name)
    assert "0x181" in text
    assert "0-1 signal (signed little-endian), 2-5 signal (signed little-endian), 6-7 counter" in text
    assert "axis1: torque x181.value_a, angle x181.value_c" in text
    assert f"Next: axiswatch commission {log.name} --config axis.toml" in text
    assert "no problems" in shown("check", "--config", "axis.toml")
    (bus,) = load(Path("axis.toml"), {}).bus
    assert [(m.name, m.id, [s.start_bit for s in m.signal]) for m in bus.message] == [("x181", 0x181, [0, 16, 48])]
    assert "axis.toml is there already; --force overwrites it" in refused("discover", log.name)


def test_what_is_left_out_of_a_record_is_named(tmp_path: Path, seed: int) -> None:
    log = log_of(demo(tmp_path, 1), tmp_path / "unknown.log", seed)
    packed = gzip.compress(log.read_bytes())[:-5000]
    (tmp_path / "unknown.log.gz").write_bytes(packed)
    text = shown("discover", tmp_path / "unknown.log.gz", "--output", tmp_path / "axis.toml")
    assert "unknown.log.gz, line " in text
    assert ": left out, and 1 more" in text


@pytest.mark.records
def test_where_nothing_moves_no_axis_is_made_up(records_dir: Path, tmp_path: Path) -> None:
    result = axiswatch("discover", records_dir / "can/inverter_idle.log", "--output", tmp_path / "axis.toml")
    assert result.exit_code == MISTAKE
    assert "byte 0 chooses between 4 meanings of the others: only a DBC can describe that" in result.stdout
    assert "no torque and motion of an axis among these numbers; record while the robot moves" in result.stderr
    assert not (tmp_path / "axis.toml").exists()


def test_mistakes(tmp_path: Path, seed: int) -> None:
    log, output = log_of(demo(tmp_path, 1), tmp_path / "a.log", seed, 1.0), tmp_path / "axis.toml"
    assert "give either a CAN log or --bus" in refused("discover")
    assert "give either a CAN log or --bus" in refused("discover", log, "--bus", "virtual:x")
    (tmp_path / "a.csv").write_text("t,u,y\n")
    assert "is no CAN log" in refused("discover", tmp_path / "a.csv", "--output", output)
    assert "no channel can7 in" in refused("discover", log, "--channel", "can7", "--output", output)
