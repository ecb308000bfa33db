"""Compiled conversion of blocks of frames of one axis to samples: frame by frame through its clock and its pairing."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.kernel.compile import outlined, short_entry
from monitor_core.sampling.controller_clocks import GIVEN, READY, VALUE, Clock
from monitor_core.sampling.controller_cycle import cyclic_clock, read_cycle, release_held
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
from monitor_core.sampling.sample_counter import count_time, counter_clock
from monitor_core.sampling.stamp_meter import frame_received, new_meter, sample_timed

RECEIPT, COUNTER, CYCLIC = 0, 1, 2
"""Sources of the times of samples"""


class Stream(NamedTuple):
    """State of the conversion of the frames of an axis."""

    clock: int
    """Source of the times: RECEIPT, COUNTER or CYCLIC"""
    clocks: tuple[Clock, Clock]
    """Clocks of frames without and with motion; COUNTER uses only the first one"""
    pairing: Pairing
    meter: NDArray[np.void]
    scratch: NDArray[np.void]
    """(1,) values of the last frame"""


HAS_TORQUE, HAS_MOTION, HAS_COUNT = 1, 2, 4
"""Bits of the field ``has`` of a FRAME"""


FRAME = np.dtype(
    [
        ("place", "i8"),  # index in its block
        ("received_us", "i8"),
        ("torque", "f8"),  # N m
        ("motion", "f8"),  # rad or rad/s
        ("counter", "f8"),
        ("has", "u1"),
    ]
)
"""The values in a frame of an axis; ``has`` says which of them are present"""


def new_scratch() -> NDArray[np.void]:
    """An empty record for ``Stream.scratch``."""
    return np.zeros(1, VALUE)


def new_samples(stream: Stream, number: int) -> NDArray[np.void]:
    """An array of SAMPLE, large enough for the samples that ``number`` frames and the waiting values can complete."""
    waiting = sum(clock.values.shape[1] for clock in stream.clocks)
    return np.zeros(number + waiting + 1, SAMPLE)


def compile_stream(cyclic: bool = False) -> None:
    """Compile the functions that take frames, or load them from the cache.

    Args:
        cyclic: those of the clock that is fitted to cycles; otherwise those for a counter and for times of receipt.
    """
    clock = (cyclic_clock if cyclic else partial(counter_clock, bits=1))(1.0)
    pairing = new_pairing(1.0, 0.1, 1.0, 1.0, (1.0, 1.0))
    kind = CYCLIC if cyclic else RECEIPT
    stream = Stream(kind, (clock, clock), pairing, new_meter(1.0), new_scratch())
    samples = new_samples(stream, 0)
    take_frames(stream, np.zeros(0, FRAME), samples)
    flush_frames(stream, samples)


def take_frames(stream: Stream, values: NDArray[np.void], samples: NDArray[np.void]) -> int:
    """Take frames in the order of receipt; returns the number of completed samples.

    Args:
        stream: state of the axis; it is updated.
        values: the frames (N,), of type FRAME.
        samples: array for the completed samples, from ``new_samples``.
    """
    return int((_take_cyclic if stream.clock == CYCLIC else _take)(stream, values, samples))


def flush_frames(stream: Stream, samples: NDArray[np.void]) -> int:
    """Complete the samples of held values after the last frame, and count values without a partner.

    Returns the number of completed samples.
    """
    if stream.clock == CYCLIC:
        return int(_flush_cyclic(stream, samples))
    _flush(stream.pairing)
    return 0


# Two compiled functions for each of the two: only axes that need the cyclic clock wait for its compilation.


@short_entry
def _take(stream: Stream, values: NDArray[np.void], samples: NDArray[np.void]) -> Any:
    """Take frames whose time is a counter, or the time of receipt."""
    number: Any = np.int64(0)
    value = stream.scratch[0]
    for k in range(len(values)):
        if not _read_frame(stream, values, k):
            continue
        sample_us: Any = np.int64(NO_TIME)
        if stream.clock == COUNTER and values[k].has & HAS_COUNT != 0:
            sample_us, reason = count_time(stream.clocks[0].state[0], value.received_us, values[k].counter)
            if reason != GIVEN:
                stream.pairing.state[0].dropped[reason] += value.has_torque + value.has_motion
                continue
            sample_timed(stream.meter[0], value.received_us, sample_us)
        number = _assemble(stream, value, value.received_us, sample_us, samples, number)
    return number


@short_entry
def _take_cyclic(stream: Stream, values: NDArray[np.void], samples: NDArray[np.void]) -> Any:
    number: Any = np.int64(0)
    value = stream.scratch[0]
    for k in range(len(values)):
        if _read_frame(stream, values, k):
            clock = stream.clocks[1] if value.has_motion else stream.clocks[0]
            read_cycle(clock.state[0], clock.values, value)
            number = _take_ready(stream, clock, samples, number)
    return number


@short_entry
def _flush(pairing: Pairing) -> None:
    flush_pairing(pairing.state[0], pairing.waiting)


@short_entry
def _flush_cyclic(stream: Stream, samples: NDArray[np.void]) -> Any:
    number: Any = np.int64(0)
    for clock in stream.clocks:
        if clock.state[0].runs:
            clock.state[0].ready = 0
            release_held(clock.state[0], clock.values)
            number = _take_ready(stream, clock, samples, number)
    flush_pairing(stream.pairing.state[0], stream.pairing.waiting)
    return number


@outlined
def _read_frame(stream: Stream, values: NDArray[np.void], k: int) -> bool:
    """Copy the values of frame k to ``stream.scratch``; returns whether it has any."""
    frame, value = values[k], stream.scratch[0]
    value.place, value.received_us, has = frame.place, frame.received_us, frame.has
    value.torque, value.motion = frame.torque, frame.motion
    value.has_torque, value.has_motion = has & HAS_TORQUE != 0, has & HAS_MOTION != 0
    if value.has_motion:
        frame_received(stream.meter[0], value.received_us)
    return bool(value.has_torque or value.has_motion)


@outlined
def _take_ready(stream: Stream, clock: Clock, samples: NDArray[np.void], number: Any) -> Any:
    """Pair the values whose times are now known, or count them as dropped; returns the new number of samples."""
    for k in range(clock.state[0].ready):
        value = clock.values[READY, k]
        if value.reason != GIVEN:
            stream.pairing.state[0].dropped[value.reason] += value.has_torque + value.has_motion
            continue
        if value.has_motion:
            sample_timed(stream.meter[0], value.received_us, value.time_us)
        number = _assemble(stream, value, value.time_us, np.int64(NO_TIME), samples, number)
    return number


@outlined
def _assemble(stream: Stream, value: Any, t_us: int, sample_us: Any, samples: NDArray[np.void], number: Any) -> Any:
    p, waiting, sample = stream.pairing.state[0], stream.pairing.waiting, samples[number]
    if value.has_torque and value.has_motion:
        complete = add_pair(p, waiting, t_us, value.torque, value.motion, sample_us, sample)
    else:  # one call with a variable kind: numba would compile add_value again for each constant
        kind: Any = np.int64(TORQUE if value.has_torque else MOTION)
        quantity = value.torque if value.has_torque else value.motion
        complete = add_value(p, waiting, kind, t_us, quantity, sample_us, sample)
    if complete:
        sample.place, sample.received_us = stream.scratch[0].place, stream.scratch[0].received_us
        return number + 1
    return number
