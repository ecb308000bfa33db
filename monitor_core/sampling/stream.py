"""The frames of one axis in blocks: its clock and its pairing, frame by frame, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry, outlined
from monitor_core.sampling.controller_clocks import (
    GIVEN,
    READY,
    VALUE,
    Clock,
    count_time,
    counter_clock,
    read_cycle,
    release_held,
)
from monitor_core.sampling.pairing import (
    MOTION,
    NO_TIME,
    SAMPLE,
    TORQUE,
    Pairing,
    add_pair,
    add_value,
    flush_pairing,
    new_pairing,
)
from monitor_core.sampling.stamp_meter import frame_received, new_meter, sample_timed

RECEIPT, COUNTER, CYCLIC = 0, 1, 2
"""What gives the times of the samples"""


class Stream(NamedTuple):
    """Everything that is known of the frames of an axis."""

    clock: int
    """RECEIPT, COUNTER or CYCLIC"""
    clocks: tuple[Clock, Clock]
    """Of frames without and with motion; only the first one counts"""
    pairing: Pairing
    meter: NDArray[np.void]
    scratch: NDArray[np.void]
    """(1,) the last frame"""


HAS_TORQUE, HAS_MOTION, HAS_COUNT = 1, 2, 4
"""Bits of ``FrameValues.has``"""


class FrameValues(NamedTuple):
    """The values in frames of an axis, in the order of receipt; each (N,)."""

    places: Ints
    """In their block"""
    received_us: Ints
    torque: Floats
    """N m"""
    motion: Floats
    """rad or rad/s"""
    counter: Floats
    """Of the sample counter"""
    has: NDArray[np.uint8]
    """Which of them a frame has"""


def new_scratch() -> NDArray[np.void]:
    """For ``Stream``."""
    return np.zeros(1, VALUE)


def room_for_samples(stream: Stream, number: int) -> NDArray[np.void]:
    """Room for the samples that so many frames may complete, and those that wait."""
    waiting = sum(clock.values.shape[1] for clock in stream.clocks)
    return np.zeros(number + waiting + 1, SAMPLE)


def compile_stream() -> None:
    """Compile what the frames of any axis need, or load it from its cache."""
    clocks = counter_clock(1.0, 1), counter_clock(1.0, 1)
    pairing = new_pairing(1.0, 0.1, 1.0, 1.0, (1.0, 1.0))
    stream, none = Stream(RECEIPT, clocks, pairing, new_meter(1.0), new_scratch()), np.zeros(0)
    values = FrameValues(
        none.astype(np.int64), none.astype(np.int64), none, none, none, none.astype(np.uint8)
    )
    samples = room_for_samples(stream, 0)
    take_frames(stream, values, samples)
    flush_frames(stream, samples)


@entry
def take_frames(stream: Stream, values: FrameValues, samples: NDArray[np.void]) -> int:
    """Take frames in the order of receipt; returns how many samples are complete.

    Args:
        stream: of the axis.
        values: of the frames.
        samples: room for the samples (at least N and those that wait), of SAMPLE.
    """
    number, value = 0, stream.scratch[0]
    for k in range(len(values.places)):
        has = values.has[k]
        value.place, value.received_us = values.places[k], values.received_us[k]
        value.torque, value.motion = values.torque[k], values.motion[k]
        value.has_torque, value.has_motion = has & HAS_TORQUE != 0, has & HAS_MOTION != 0
        if not (value.has_torque or value.has_motion):
            continue
        if value.has_motion:
            frame_received(stream.meter[0], value.received_us)
        if stream.clock == CYCLIC:
            clock = stream.clocks[1] if value.has_motion else stream.clocks[0]
            read_cycle(clock.state[0], clock.values, value)
            number = _take_ready(stream, clock, samples, number)
            continue
        sample_us = NO_TIME
        if stream.clock == COUNTER and has & HAS_COUNT != 0:
            sample_us, reason = count_time(stream.clocks[0].state[0], value.received_us, values.counter[k])
            if reason != GIVEN:
                stream.pairing.state[0].dropped[reason] += value.has_torque + value.has_motion
                continue
            sample_timed(stream.meter[0], value.received_us, sample_us)
        number = _assemble(stream, value, value.received_us, sample_us, samples, number)
    return number


@entry
def flush_frames(stream: Stream, samples: NDArray[np.void]) -> int:
    """End of the frames: the samples of held values; values without a partner are counted."""
    number = 0
    if stream.clock == CYCLIC:
        for clock in stream.clocks:
            if clock.state[0].runs:
                clock.state[0].ready = 0
                release_held(clock.state[0], clock.values)
                number = _take_ready(stream, clock, samples, number)
    flush_pairing(stream.pairing.state[0], stream.pairing.waiting)
    return number


@outlined
def _take_ready(stream: Stream, clock: Clock, samples: NDArray[np.void], number: int) -> int:
    """The samples completed by values whose times are known now."""
    for k in range(clock.state[0].ready):
        value = clock.values[READY, k]
        if value.reason != GIVEN:
            stream.pairing.state[0].dropped[value.reason] += value.has_torque + value.has_motion
            continue
        if value.has_motion:
            sample_timed(stream.meter[0], value.received_us, value.time_us)
        number = _assemble(stream, value, value.time_us, NO_TIME, samples, number)
    return number


@outlined
def _assemble(
    stream: Stream, value: Any, t_us: int, sample_us: int, samples: NDArray[np.void], number: int
) -> int:
    p, waiting, sample = stream.pairing.state[0], stream.pairing.waiting, samples[number]
    if value.has_torque and value.has_motion:
        found = add_pair(p, waiting, t_us, value.torque, value.motion, sample_us, sample)
    elif value.has_torque:
        found = add_value(p, waiting, TORQUE, t_us, value.torque, sample_us, sample)
    else:
        found = add_value(p, waiting, MOTION, t_us, value.motion, sample_us, sample)
    if found:
        sample.place, sample.received_us = stream.scratch[0].place, stream.scratch[0].received_us
        return number + 1
    return number
