"""Times of frames from the stamps of the kernel and of the hardware, and where the kernel notes them."""

import socket
import time
from collections.abc import Iterator
from threading import Event
from typing import Any

import can
import numpy as np
import pytest
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from service.can import socket_receivers
from service.can.bus import send
from service.can.socket_receivers import StampClock, receiver_of
from tests.ports import own_port
from tests.service.can.read_frames import STANDARD

NOON_NS = 1_760_000_000_000_000_000
SOFTWARE = 1 << 3 | 1 << 4
"""SOF_TIMESTAMPING_RX_SOFTWARE and _SOFTWARE: every kernel then notes three times, that of hardware as zero."""


def noted(kernel_ns: Floats, hardware_ns: Floats | None = None) -> NDArray[np.void]:
    """What the kernel notes of frames."""
    notes = np.zeros(len(kernel_ns), socket_receivers._NOTES)
    notes["first"]["type"] = socket_receivers._SO_TIMESTAMPNS
    for name, values in (("time", kernel_ns), ("hardware", hardware_ns)):
        if values is not None:
            notes[name]["s"], notes[name]["ns"] = np.divmod(values.astype(np.int64), 1_000_000_000)
    if hardware_ns is not None:
        notes["second"]["type"] = socket_receivers._SO_TIMESTAMPING
    return notes


def blocks(seed: int, hardware_from_ns: int, ppm: float = 100.0) -> Iterator[tuple[Floats, Floats, Floats]]:
    """True times, those of the kernel and those of the hardware, of frames each millisecond for a minute."""
    rng = np.random.default_rng(seed)
    for first in range(0, 60_000, 30):
        true = (first + np.arange(30.0)) * 1e6
        late = rng.exponential(2e5, 30) + 2e4
        yield NOON_NS + true, NOON_NS + true + late, hardware_from_ns + true * (1 + ppm * 1e-6)


@pytest.mark.parametrize("since_ns", [0.0, NOON_NS - 3e9], ids=["from power-on", "from 1970"])
def test_the_hardware_says_when_and_the_clock_of_the_machine_what_time_it_is(seed: int, since_ns: int) -> None:
    clock, errors, intervals = StampClock(), [], []
    for true, kernel, hardware in blocks(seed, int(since_ns) + 5_000_000):
        found = clock.times_us(noted(kernel, hardware))
        errors.append(found - true * 1e-3)
        intervals.append(np.diff(found))
    assert np.abs(np.concatenate(errors[30:])).max() < 300
    assert np.abs(np.concatenate(intervals) - 1000).max() <= 1
    assert max(np.abs(np.diff(kernel)).max() for _, kernel, _ in blocks(seed, 0)) > 1.5e6


def test_a_clock_that_is_set_is_followed_at_once(seed: int) -> None:
    clock = StampClock()
    for n, (true, kernel, hardware) in enumerate(blocks(seed, 5_000_000)):
        moved = true + (3.6e12 if n > 500 else 0), kernel + (3.6e12 if n > 500 else 0)
        restarted = hardware - (4e9 if n > 1000 else 0)
        found = clock.times_us(noted(moved[1], restarted))
        assert np.abs(found - moved[0] * 1e-3).max() < 1500


def test_frames_without_a_stamp_of_the_hardware_have_that_of_the_kernel() -> None:
    clock, kernel = StampClock(), NOON_NS + np.arange(4.0) * 1e9
    notes = noted(kernel, np.array([1e9, 0.0, 0.0, 4e9]))
    notes["second"]["type"][2] = socket_receivers._SO_RXQ_OVFL
    assert clock.times_us(notes).tolist() == (kernel / 1e3).astype(int).tolist()
    assert clock.times_us(noted(kernel)).tolist() == (kernel / 1e3).astype(int).tolist()
    notes["first"]["type"][1] = 0
    assert abs(clock.times_us(notes)[1] - time.time_ns() // 1000) < 60_000_000


@pytest.mark.parametrize("flags", [0, SOFTWARE], ids=["one note", "two notes"])
def test_the_kernel_notes_times_and_drops_where_they_are_looked_for(flags: int) -> None:
    options: dict[str, Any] = {"hop_limit": 0, "port": own_port(), "ignore_config": True}
    bus, sender = (can.Bus("239.74.163.6", "udp_multicast", **options) for _ in range(2))
    try:
        receiver, before_us = receiver_of(bus), time.time_ns() // 1000
        with socket.socket(fileno=bus.fileno()) as same:
            same.setsockopt(socket.SOL_SOCKET, socket_receivers._SO_TIMESTAMPING, flags)
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
            same.detach()
        for k in range(200):
            send(sender, STANDARD, bytes([k]))
        found = list(receiver.read(256, Event()).frames.frames())
        send(sender, STANDARD, b"last")  # the count comes with a frame after the loss
        found += receiver.read(256, Event()).frames.frames()
    finally:
        bus.shutdown()
        sender.shutdown()
    assert receiver.overflow == 201 - len(found) > 0
    assert [frame.data for frame in found[:2]] == [b"\0", b"\1"]
    assert all(before_us <= frame.t_us <= time.time_ns() // 1000 for frame in found)
