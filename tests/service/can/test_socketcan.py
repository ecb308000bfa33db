"""The reader on real SocketCAN devices: filters, buffers, drops, and devices that come and go."""

import random
import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event

import can
import pytest
from can.interfaces.socketcan import SocketcanBus

from service.can import bus_reader
from service.can.bus import open_bus, send
from service.can.bus_reader import CanReader
from service.can.frames import Frame, FrameFilter, FrameKey
from service.can.receivers import FrameReceiver
from service.can.socket_receivers import SocketReceiver, receiver_of
from service.can.user_errors import BusError
from service.commands.play import PlayFrame, play_frames
from service.config.schema import BusConfig
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.can.network_devices import ip
from tests.service.can.read_frames import EXTENDED, STANDARD, reading, take
from tests.service.ingest.plant import axis1, make_config

pytestmark = pytest.mark.vcan


def bus_config(folder: Path, channel: str = "vcan0", **bus: object) -> BusConfig:
    return make_config(folder, axis1(), interface="socketcan", channel=channel, **bus).bus[0]


@pytest.fixture
def device() -> Iterator[str]:
    """A device of this test's own, up."""
    name = "vcan7"
    ip("link", "add", "dev", name, "type", "vcan")
    ip("link", "set", name, "up")
    yield name
    if Path("/sys/class/net", name).exists():
        ip("link", "del", name)


def test_error_and_remote_frames_are_counted(tmp_path: Path) -> None:
    config = bus_config(tmp_path)
    with reading(config) as reader, open_bus(config) as sender:
        with socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
            raw.bind((config.channel,))
            raw.send(struct.pack("=IB3x8s", 0x20000044, 8, bytes.fromhex("0000000000008081")))
        sender.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
        send(sender, STANDARD, b"x")
        assert [f.data for f in take(reader, 1)] == [b"x"]
        stats = reader.stats()
    assert (stats.frames, stats.dropped["error_frame"], stats.dropped["remote_frame"]) == (1, 1, 1)


def test_can_fd_frames_come_unless_the_option_forbids_it(tmp_path: Path) -> None:
    classic, fd = bus_config(tmp_path, options={"fd": False}), bus_config(tmp_path)
    with reading(classic) as classic_reader, reading(fd) as fd_reader, open_bus(fd) as sender:
        send(sender, STANDARD, bytes(range(64)))
        send(sender, STANDARD, b"classic")
        assert [f.data for f in take(fd_reader, 2)] == [bytes(range(64)), b"classic"]
        assert [f.data for f in take(classic_reader, 1)] == [b"classic"]


def test_the_kernel_lets_a_parameter_group_through_with_any_priority(tmp_path: Path) -> None:
    config, group = bus_config(tmp_path), FrameKey(0xFF3121, True)
    with open_bus(config, [FrameFilter(group, 0x3FFFFFF)]) as bus, open_bus(config) as sender:
        receiver = receiver_of(bus)
        for can_id in (0x18FF3121, 0x0CFF3121, 0x18FF3122, 0x19FF3121):
            send(sender, FrameKey(can_id, True), b"x")
        send(sender, FrameKey(0x121, False), b"x")
        found = all_of(receiver, 2) + list(receiver.read(100, Event()).frames.frames())
    assert [frame.can_id for frame in found] == [0x18FF3121, 0x0CFF3121]


def test_nothing_is_lost_at_4000_frames_a_second(tmp_path: Path) -> None:
    config = bus_config(tmp_path)
    count = 4000
    frames = (
        PlayFrame(k / 4000, "bus0", EXTENDED if k % 2 else STANDARD, k.to_bytes(2, "little"), 0.0) for k in range(count)
    )
    with reading(config) as reader, open_bus(config) as sender:
        player = threading.Thread(target=lambda: list(play_frames({"bus0": sender}, frames)))
        player.start()
        received = take(reader, count)
        player.join()
        stats = reader.stats()
    assert [int.from_bytes(f.data, "little") for f in received] == list(range(count))
    assert set(stats.dropped.values()) == {0}


def receiver_with_small_buffer(bus: can.BusABC) -> FrameReceiver:
    receiver = receiver_of(bus)
    assert isinstance(bus, SocketcanBus)
    bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
    return receiver


def test_the_reader_tells_what_the_kernel_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_reader, "receiver_of", receiver_with_small_buffer)
    config = bus_config(tmp_path)
    reader, sent = CanReader(config, [FrameFilter(STANDARD)]), 300
    reader.open()
    with open_bus(config) as sender:
        for k in range(300):
            send(sender, STANDARD, k.to_bytes(2, "little"))
        reader.start()
        wait_for(lambda: reader.stats().frames > 0, reader.stats)
        while not reader.stats().dropped["kernel_overflow"]:  # the count comes with a frame after the loss
            send(sender, STANDARD, b"x")
            sent += 1
            time.sleep(0.05)
        wait_for(  # the last may still wait in the kernel
            lambda: reader.stats().frames + reader.stats().dropped["kernel_overflow"] >= sent, reader.stats
        )
    reader.close()
    stats = reader.stats()
    assert stats.frames + stats.dropped["kernel_overflow"] == sent


def test_the_buffer_holds_a_pause_of_the_reader(tmp_path: Path) -> None:
    config = bus_config(tmp_path)
    with open_bus(config, [FrameFilter(STANDARD)]) as bus, open_bus(config) as sender:
        receiver = receiver_of(bus)
        for k in range(5000):
            send(sender, STANDARD, k.to_bytes(2, "little"))
        received = all_of(receiver, 5000)
        assert [int.from_bytes(frame.data, "little") for frame in received] == list(range(5000))
        assert receiver.overflow == 0


def all_of(receiver: FrameReceiver, count: int) -> list[Frame]:
    """The frames that wait, in blocks of no more than a hundred."""
    found, end = list[Frame](), time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < end:
        block = receiver.read(100, Event()).frames
        assert block.size <= 100
        found += block.frames()
    return found


def test_both_readers_give_the_same_frames(tmp_path: Path, seed: int) -> None:
    """Of the same bus: classic ones and CAN FD, standard and extended ids, error and remote frames, all lengths."""
    config, rng = bus_config(tmp_path, options={"fd": True}), random.Random(seed)
    lengths = [*range(9), 12, 16, 20, 24, 32, 48, 64]
    with open_bus(config) as first, open_bus(config) as second, open_bus(config) as sender:
        in_blocks, single = receiver_of(first), FrameReceiver(second)
        assert isinstance(in_blocks, SocketReceiver)
        sent, found, expected = list[tuple[FrameKey, bytes]](), list[Frame](), list[Frame]()
        for k in range(600):  # shorter data after longer, so that no old byte may be left
            extended = rng.random() < 0.5
            key = FrameKey(rng.randrange(2**29 if extended else 2**11), extended)
            sent.append((key, rng.randbytes(rng.choice(lengths))))
            send(sender, *sent[-1])
            if k % 100 == 50:
                sender.send(can.Message(arbitration_id=1, is_extended_id=False, is_remote_frame=True))
            if k % 200 == 199:  # python-can's buffer holds 278
                found += all_of(in_blocks, 200)
                expected += all_of(single, 200)
    assert [(frame.key, frame.data) for frame in found] == sent
    assert [frame[1:] for frame in found] == [frame[1:] for frame in expected]
    # python-can has the time as a float of seconds.
    assert all(abs(a.t_us - b.t_us) <= 1 for a, b in zip(found, expected, strict=True))
    assert [frame.t_us for frame in found] == sorted(frame.t_us for frame in found)


def test_a_bus_says_how_it_is_read(tmp_path: Path) -> None:
    with reading(bus_config(tmp_path)) as reader:
        assert reader.stats().reader == "socketcan in blocks"


def test_an_adapter_that_is_down_needs_its_bit_rate(tmp_path: Path, device: str) -> None:
    """A device whose name is not that of a virtual one is taken for an adapter."""
    ip("link", "set", device, "down")
    ip("link", "set", device, "name", "can7")
    try:
        reader = CanReader(bus_config(tmp_path, "can7"), [FrameFilter(STANDARD)])
        reader.open()
        assert reader.stats().state.endswith("for 500 kbit/s: `ip link set can7 up type can bitrate 500000`")
        reader.close()
    finally:
        ip("link", "set", "can7", "name", device)
        ip("link", "set", device, "up")


def test_down_and_up_again(tmp_path: Path, device: str) -> None:
    config = bus_config(tmp_path, device)
    with reading(config) as reader:
        with open_bus(config) as sender:
            send(sender, STANDARD, b"before")
        assert [f.data for f in take(reader, 1)] == [b"before"]
        ip("link", "set", device, "down")
        wait_for(lambda: not reader.stats().up, reader.stats)
        assert reader.stats().state == f"down: the interface is down; bring it up with `ip link set {device} up`"
        ip("link", "set", device, "up")
        wait_for(lambda: reader.stats().up, reader.stats)
        with open_bus(config) as sender:
            send(sender, STANDARD, b"after")
        assert [f.data for f in take(reader, 1)] == [b"after"]
        assert reader.stats().frames == 2


def test_frames_received_before_it_went_down_are_kept(tmp_path: Path, device: str) -> None:
    config = bus_config(tmp_path, device)
    reader = CanReader(config, [FrameFilter(STANDARD)])
    reader.open()
    with open_bus(config) as sender:
        for k in range(10):
            send(sender, STANDARD, bytes([k]))
    ip("link", "set", device, "down")
    reader.start()
    assert [f.data[0] for f in take(reader, 10)] == list(range(10))
    wait_for(lambda: not reader.stats().up, reader.stats)
    reader.close()


def test_deleted_and_created_again(tmp_path: Path, device: str) -> None:
    config = bus_config(tmp_path, device)
    with reading(config) as reader:
        ip("link", "del", device)
        wait_for(lambda: f"no network interface {device}" in reader.stats().state, reader.stats)
        ip("link", "add", "dev", device, "type", "vcan")
        ip("link", "set", device, "up")
        wait_for(lambda: reader.stats().up, reader.stats)
        with open_bus(config) as sender:
            send(sender, STANDARD, b"after")
        assert [f.data for f in take(reader, 1)] == [b"after"]


def test_started_before_it_exists(tmp_path: Path) -> None:
    reader = CanReader(bus_config(tmp_path, "vcan8"), [FrameFilter(STANDARD)])
    reader.start()
    wait_for(lambda: "no network interface vcan8" in reader.stats().state, reader.stats)
    assert "bus " not in reader.stats().state, "the bus is named beside its state"
    ip("link", "add", "dev", "vcan8", "type", "vcan")
    try:
        ip("link", "set", "vcan8", "up")
        wait_for(lambda: reader.stats().up, reader.stats)
    finally:
        reader.close()
        ip("link", "del", "vcan8")


def test_sending_on_an_interface_that_is_down(tmp_path: Path, device: str) -> None:
    with open_bus(bus_config(tmp_path, device)) as sender:
        ip("link", "set", device, "down")
        with pytest.raises(BusError, match=f"cannot send on socketcan channel '{device}'"):
            send(sender, STANDARD, b"x")
