"""The reader of a bus, on python-can's buses in the process and over the network stack."""

import random
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Event
from typing import Any

import can
import pytest

from service.can.bus import can_devices, open_bus, send
from service.can.bus_reader import CanReader, FrameQueue
from service.can.frames import Frame, FrameBlock, FrameFilter, FrameKey
from service.can.receivers import FrameReceiver, Rejected, frame_of
from service.can.socket_receivers import receiver_of
from service.can.user_errors import BusError
from service.config.remarks import remarks
from service.config.schema import BusConfig
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.ports import own_port
from tests.service.can.read_frames import EXTENDED, STANDARD, reading, take
from tests.service.ingest.plant import axis1, axis2, axis4, make_config


@pytest.fixture(params=["virtual", "udp_multicast", pytest.param("socketcan", marks=pytest.mark.vcan)])
def bus_config(request: pytest.FixtureRequest, tmp_path: Path) -> BusConfig:
    if request.param == "virtual":
        return make_config(tmp_path, axis1()).bus[0]
    if request.param == "socketcan":
        return make_config(tmp_path, axis1(), interface="socketcan", channel="vcan0", options={"fd": True}).bus[0]
    options = {"port": own_port(), "hop_limit": 0, "fd": True}
    return make_config(tmp_path, axis1(), interface="udp_multicast", channel="239.74.163.2", options=options).bus[0]


def test_frames_arrive_in_order_with_the_time_of_their_receipt(bus_config: BusConfig) -> None:
    before_us = time.time_ns() // 1000
    with reading(bus_config) as reader, open_bus(bus_config) as sender:
        frames: list[Frame] = []
        for k in range(500):
            send(sender, EXTENDED if k % 2 else STANDARD, bytes([k % 256, k // 256]))
            if k % 50 == 49:  # the buffer of a UDP socket is small
                frames += take(reader, 50)
        stats = reader.stats()
    after_us = time.time_ns() // 1000
    assert [int.from_bytes(f.data, "little") for f in frames] == list(range(500))
    assert {(f.can_id, f.extended) for f in frames} == {STANDARD, EXTENDED}
    # The kernel stamps frames by the same clock; python-can's time is another one.
    apart_us = 0 if bus_config.interface == "socketcan" else 1000
    assert all(before_us - apart_us <= f.t_us <= after_us + 1 + apart_us for f in frames)
    assert (stats.state, stats.up, stats.frames) == ("up", True, 500)
    assert set(stats.dropped.values()) == {0}


def test_unwanted_frames_stay_outside(bus_config: BusConfig) -> None:
    with reading(bus_config, EXTENDED) as reader, open_bus(bus_config) as sender:
        for key in (STANDARD, FrameKey(0x100, True), FrameKey(0x0FF0100 & 0x7FF, False), EXTENDED):
            send(sender, key, b"x")
        assert [f.key for f in take(reader, 1)] == [EXTENDED]
        assert reader.stats().frames == 1
    assert (reader.stats().state, reader.stats().up) == ("closed", False)


@contextmanager
def multicast(*filters: FrameKey) -> Iterator[tuple[can.BusABC, can.BusABC, can.BusABC]]:
    """Two buses that receive, with these filters, and a third that sends."""
    options: dict[str, Any] = {"hop_limit": 0, "port": own_port()}
    wanted: Any = [{"can_id": k.can_id, "can_mask": 0x1FFFFFFF, "extended": k.extended} for k in filters]
    with ExitStack() as stack:
        buses = [
            can.Bus("239.74.163.3", "udp_multicast", can_filters=own, ignore_config=True, **options)
            for own in (wanted or None, wanted or None, None)
        ]
        for bus in buses:
            stack.callback(bus.shutdown)
        wait_for_stamps(*buses)
        yield buses[0], buses[1], buses[2]


def wait_for_stamps(first: can.BusABC, second: can.BusABC, sender: can.BusABC) -> None:
    """Wait until the kernel stamps datagrams when they come.

    It begins to some time after a socket has asked for it; until then each socket has the time of its reading.
    """
    end, pause_s = time.monotonic() + PATIENCE_S, 0.02
    stamped = False
    while not stamped:
        assert time.monotonic() < end
        send(sender, STANDARD, b"stamped?")
        sent = time.time()
        time.sleep(pause_s)
        messages = [bus.recv(5.0) for bus in (first, second)]
        stamped = all(m is not None and m.timestamp < sent + pause_s / 2 for m in messages)


def until_last(receiver: FrameReceiver) -> tuple[list[Frame], Counter[Rejected]]:
    """The frames up to one with the data "last", and the number of rejected ones."""
    frames, rejected = list[Frame](), Counter[Rejected]()
    end = time.monotonic() + PATIENCE_S
    while not frames or frames[-1].data != b"last":
        assert time.monotonic() < end
        received = receiver.read(40, Event())
        assert received.frames.size <= 40
        frames += received.frames.frames()
        rejected.update(received.rejected)
    return frames, rejected


@pytest.mark.parametrize("filtered", [False, True])
def test_datagrams_in_blocks_give_the_frames_that_python_can_gives(seed: int, filtered: bool) -> None:
    rng = random.Random(seed)
    keys = [STANDARD, EXTENDED, FrameKey(0x100, True), FrameKey(0x7FF, False)]
    with multicast(*keys[:2] if filtered else ()) as (first, second, sender):
        in_blocks, single = receiver_of(first), FrameReceiver(second)
        assert in_blocks.name == "udp_multicast in blocks"
        found, expected = list[Frame](), list[Frame]()
        rejected, expected_rejected = Counter[Rejected](), Counter[Rejected]()
        for _ in range(3):  # as much as waits in the smallest buffer of a socket
            for _ in range(50):  # shorter data after longer
                send(sender, rng.choice(keys), rng.randbytes(rng.choice([*range(9), 12, 32, 64])))
            sender.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
            sender.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_error_frame=True))
            send(sender, STANDARD, b"last")
            for receiver, frames, others in (
                (in_blocks, found, rejected),
                (single, expected, expected_rejected),
            ):
                more = until_last(receiver)
                frames += more[0]
                others += more[1]
    assert rejected == expected_rejected == {"remote_frame": 3, "error_frame": 3}
    assert {frame.key for frame in found} == set(keys[:2] if filtered else keys)
    assert [frame[1:] for frame in found] == [frame[1:] for frame in expected]
    # python-can has the time as a float of seconds.
    assert all(abs(a.t_us - b.t_us) <= 1 for a, b in zip(found, expected, strict=True))


def test_groups_that_share_a_port_are_different_buses() -> None:
    """As two robots that nobody gave a port of their own."""
    options: dict[str, Any] = {"hop_limit": 0, "port": own_port()}
    for groups in (("239.74.163.4", "239.74.163.5"), ("ff15::74:4", "ff15::74:5")):
        with ExitStack() as stack:
            own, other = (can.Bus(g, "udp_multicast", ignore_config=True, **options) for g in groups)
            for bus in (own, other):
                stack.callback(bus.shutdown)
            receiver = receiver_of(own)
            send(other, STANDARD, b"other")
            send(own, STANDARD, b"last")
            frames, _ = until_last(receiver)
        assert [frame.data for frame in frames] == [b"last"]


def test_a_datagram_without_a_frame_is_a_fault_after_the_frames_before_it() -> None:
    with multicast() as (bus, _, sender):
        receiver = receiver_of(bus)
        send(sender, STANDARD, b"last")
        sender._multicast.send(b"\xc1 no frame", 1.0)  # type: ignore[attr-defined]
        assert len(until_last(receiver)[0]) == 1
        with pytest.raises(can.CanOperationError, match="a datagram holds no frame"):
            receiver.read(10, Event())


def test_long_frames(bus_config: BusConfig) -> None:
    with reading(bus_config) as reader, open_bus(bus_config) as sender:
        send(sender, STANDARD, bytes(range(64)))
        assert take(reader, 1)[0].data == bytes(range(64))


def test_remote_and_error_frames_are_counted(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1()).bus[0]
    with reading(config) as reader, open_bus(config) as sender:
        sender.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
        sender.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_error_frame=True))
        send(sender, STANDARD, b"x")
        assert [f.data for f in take(reader, 1)] == [b"x"]
        stats = reader.stats()
    assert stats.frames == 1
    assert stats.dropped == {"queue_full": 0, "kernel_overflow": 0, "error_frame": 1, "remote_frame": 1}


def test_a_bus_with_nothing_but_error_frames_is_down(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1()).bus[0]
    with reading(config) as reader, open_bus(config) as sender:
        error = can.Message(arbitration_id=0x100, is_extended_id=False, is_error_frame=True)
        send(sender, STANDARD, b"x")
        wait_for(lambda: reader.stats().frames == 1, reader.stats)
        for _ in range(99):
            sender.send(error)
        wait_for(lambda: reader.stats().dropped["error_frame"] == 99, reader.stats)
        assert reader.stats().up
        sender.send(error)
        wait_for(lambda: not reader.stats().up, reader.stats)
        assert reader.stats().state.startswith("down: nothing but error frames since the last data; are bit rate")
        send(sender, STANDARD, b"x")
        wait_for(lambda: reader.stats().up, reader.stats)


def test_what_does_not_fit_is_counted(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1(), queue_frames=100).bus[0]
    with reading(config) as reader, open_bus(config) as sender:
        for k in range(1000):
            send(sender, STANDARD, k.to_bytes(2, "little"))
        wait_for(lambda: reader.stats().frames == 1000, reader.stats)
        turns = reader.turns  # frames are counted before they are put into the queue or dropped
        wait_for(lambda: reader.turns > turns, reader.stats)
        dropped = reader.stats().dropped["queue_full"]
        kept = take(reader, 1000 - dropped)
        assert 900 <= dropped < 1000  # whole blocks
        assert len(kept) == 1000 - dropped
        send(sender, STANDARD, b"on")  # and it goes on
        assert [f.data for f in take(reader, 1)] == [b"on"]


def test_frames_that_wait_can_be_taken_after_closing(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1()).bus[0]
    with reading(config) as reader, open_bus(config) as sender:
        send(sender, STANDARD, b"x")
        wait_for(lambda: reader.stats().frames == 1, reader.stats)
    assert [f.data for f in reader.take().frames()] == [b"x"]


@pytest.mark.parametrize(
    ("bus", "message"),
    [
        ({"interface": "no-such"}, r"bus bus0: cannot use interface no-such here"),
        (
            {"interface": "udp_multicast", "channel": "10.0.0.1"},
            r"bus bus0: cannot open udp_multicast 10\.0\.0\.1: .* \(.*Invalid argument\)",
        ),
        (
            {"interface": "udp_multicast", "channel": "239.74.163.2", "options": {"port": "x"}},
            r"bus bus0: cannot open udp_multicast 239\.74\.163\.2: ",
        ),
    ],
)
def test_a_bus_that_cannot_be_opened(tmp_path: Path, bus: dict[str, object], message: str) -> None:
    reader = CanReader(make_config(tmp_path, axis1(), **bus).bus[0], [FrameFilter(STANDARD)])
    with pytest.raises(BusError, match=message):
        reader.open()


def test_a_frame_that_is_not_accepted_in_time_is_reported_with_the_bus(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stalled(message: can.Message, timeout: float | None = None) -> None:
        raise can.CanTimeoutError

    config = make_config(tmp_path, axis1(), interface="udp_multicast", channel="239.74.163.2").bus[0]
    with open_bus(config) as sender:
        monkeypatch.setattr(sender, "send", stalled)
        with pytest.raises(
            BusError,
            match=r"^cannot send on udp_multicast 239\.74\.163\.2: no frame was accepted for 1 s$",
        ):
            send(sender, STANDARD, b"x")


def test_without_open_the_reader_keeps_trying(tmp_path: Path) -> None:
    config = make_config(tmp_path, axis1(), interface="udp_multicast", channel="10.0.0.1").bus[0]
    reader = CanReader(config, [FrameFilter(STANDARD)])
    reader.start()
    wait_for(lambda: reader.stats().state.startswith("down: cannot open udp_multicast"), reader.stats)
    assert not reader.stats().up
    reader.close()


def test_a_bus_that_a_fault_has_closed_is_down_until_it_is_open_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = make_config(tmp_path, axis1()).bus[0]
    reader, states = CanReader(config, [FrameFilter(STANDARD)]), list[str]()

    def torn_off(timeout: float | None = None) -> can.Message:
        raise OSError("adapter unplugged")

    def opened(*arguments: Any) -> can.BusABC:
        states.append(reader.stats().state)
        bus = open_bus(*arguments)
        if len(states) in (1, 3):
            monkeypatch.setattr(bus, "recv", torn_off)
        return bus

    monkeypatch.setattr("service.can.bus_reader.open_bus", opened)
    reader.start()
    wait_for(lambda: len(states) == 2 and reader.stats().up, reader.stats)
    reader.close()
    fault = "down: adapter unplugged; trying to open it again"
    assert states == ["down: not opened yet", fault]
    monkeypatch.setattr("service.can.bus_reader.RETRY_S", 3600.0)  # no other try before it is closed
    reader.start()
    wait_for(lambda: reader.stats().state == fault, reader.stats)
    reader.close()
    assert states[2:] == ["closed"]


def test_who_waits_is_told_when_frames_can_be_taken(bus_config: BusConfig) -> None:
    reader, taken = CanReader(bus_config, [FrameFilter(STANDARD)]), list[Frame]()
    reader.open()
    reader.start(lambda: taken.extend(reader.take().frames()))
    with open_bus(bus_config) as sender:
        for k in range(5):
            send(sender, STANDARD, bytes([k]))
        wait_for(lambda: len(taken) == 5, reader.stats)
    reader.close()
    assert [frame.data for frame in taken] == [bytes([k]) for k in range(5)]


@pytest.mark.parametrize("timestamp", [0.0, 12.5, 3e6])
def test_a_time_that_is_not_since_1970_is_that_of_the_receipt(timestamp: float) -> None:
    message = can.Message(timestamp=timestamp, arbitration_id=1, data=b"x")
    received, stored = frame_of(message), frame_of(message, stored=True)
    assert isinstance(received, Frame)
    assert isinstance(stored, Frame)
    assert abs(received.t_us - time.time_ns() // 1000) < 10_000_000
    assert stored.t_us == round(timestamp * 1e6)


def test_the_queue_is_bounded_in_frames() -> None:
    queue = FrameQueue(5)
    frames = [Frame(k, 1, False, bytes(k)) for k in range(6)]
    assert queue.put(FrameBlock.from_frames(frames[:3]))
    assert not queue.put(FrameBlock.from_frames(frames[3:]))  # whole blocks only
    assert queue.put(FrameBlock.from_frames(frames[3:5]))
    assert list(queue.take(1).frames()) == frames[:3]
    assert list(queue.take(100).frames()) == frames[3:5]
    assert queue.take(100).size == 0


def test_messages_of_can_fd_where_the_interface_must_be_told(tmp_path: Path) -> None:
    def notes(axis: dict[str, object], **bus: object) -> list[str]:
        return [words for words in remarks(make_config(tmp_path, axis, **bus)) if "CAN FD" in words]

    pcan: dict[str, object] = {"interface": "pcan", "channel": "PCAN_USBBUS1"}
    (words,) = notes(axis4(), **pcan)
    assert words.startswith("bus bus0: Wide4 needs CAN FD; pcan gives such frames once it is opened for them")
    for silent in (notes(axis2(), **pcan), notes(axis4(), **pcan, options={"fd": True}), notes(axis4())):
        assert silent == []


def test_the_devices_of_can(tmp_path: Path) -> None:
    for name, kind in (("eth0", 1), ("vcan1", 280), ("can0", 280)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n", encoding="ascii")
    assert can_devices(tmp_path) == ["can0", "vcan1"]
