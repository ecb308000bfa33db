"""The time of a sample on the clock of the controller: by a counter on the bus, or by its cycles alone.

Everything depends on counts and times of receipt alone, so a replay gives the same times.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.kernel.compile import outlined
from monitor_core.sampling.clock_line import (
    DRIFT_FIELDS,
    LINE_FIELDS,
    TELLING,
    WINDOW_US,
    begin_again,
    begin_line,
    expected_delay,
    follow_delay,
    is_given_up,
    new_line,
    nominal,
    restart_drift,
    see_delay,
)

GIVEN, REPEATED, OUT_OF_ORDER, UNTIMED = -1, 2, 3, 4
"""Whether there is a time, or why there is none: as places in ``DROP_REASONS``."""

WINDOW = 128
"""Cycles, of which the early frames show where the line is: at 1000 ppm it moves an eighth of a cycle meanwhile."""

PART = 0.1
"""Of the frames are earlier than the line: the very earliest may be late ones that were given the next cycle."""

KEEP = 32
"""Windows through which the line goes."""

EARLY = 0.25
"""Part of a cycle by which a frame may be before the line; all other frames are late, by up to the rest at once."""

BUNCHED = 0.1
"""Part of the frames that follow another one at once, from which on they are taken to come in bunches."""

RECENT = 64
"""Frames, of which that part is found."""

COUNTED = 0.4
"""Part of a cycle by which the last frame of a bunch may be before the line, where counting says that it is of it."""

HELD_UP = 10
"""Counts beyond the last one, within which a frame that comes soon after another one is one of a backlog."""

_MOST = int(PART * WINDOW) + 1
_LONGEST_COUNTER = 62
"""Bits: a longer counter never wraps."""
_WRAPS = 2.0**63

CLOCK = np.dtype(
    [
        *LINE_FIELDS,
        *DRIFT_FIELDS,
        ("modulus", "i8"),
        ("offset", "f8"),
        ("longest", "i8"),
        ("runs", "?"),
        ("n", "i8"),
        ("given_n", "i8"),
        ("raw", "i8"),
        ("received_us", "i8"),
        ("held", "i8"),
        ("ready", "i8"),
        ("paused", "?"),
        ("pauses", "i8"),
        ("bunched", "f8"),
    ]
)
"""A line with its drift, and what is known of the last frame."""

VALUE = np.dtype(
    [
        ("place", "i8"),
        ("received_us", "i8"),
        ("cycle", "i8"),  # the last one that it can be of; then its own
        ("torque", "f8"),
        ("motion", "f8"),
        ("has_torque", "?"),
        ("has_motion", "?"),
        ("time_us", "i8"),
        ("reason", "i8"),
    ]
)
"""The values of a frame, its place in its block, and the time that is found for it."""


HELD, READY = 0, 1
"""Of the values of a clock: cycle not known yet; given a time, or a reason, by the last frame"""


class Clock(NamedTuple):
    """A clock, and the values of frames that wait in it."""

    state: NDArray[np.void]
    """(1,)"""
    values: NDArray[np.void]
    """(2, W) HELD and READY"""

    @property
    def reanchored(self) -> int:
        """How often the line, or its phase, was restarted."""
        return int(self.state["restarts"][0] + self.state["pauses"][0])


def counter_clock(interval_s: float, bits: int, offset: float = 0.0) -> Clock:
    """A clock that unwraps a sample counter: a straight line that slowly follows the times of receipt.

    The crystals of the controller and of this machine differ.  So the line is shifted, by at most 150 ppm of the
    elapsed time, towards the smallest recent delay.  Frames that are off the line by more than half a second (or ten
    intervals) are rejected as untimed; after a second (or ten intervals) of nothing else the line restarts: a clock was
    set, or the controller was restarted.  Where a host, a gateway or a sender was held up, frames come in a burst that
    counts on: of these the first one alone is untimed.

    Args:
        interval_s: the time of one count [s].
        bits: length of the counter; it wraps at 2^bits.
        offset: of its values.
    """
    clock = _clock(interval_s, keep=1, most=1, held=0)
    clock.state["offset"] = offset
    clock.state["modulus"] = 1 << min(bits, _LONGEST_COUNTER)
    clock.state["window_us"], clock.state["step_us"] = WINDOW_US, math.inf
    return clock


def cyclic_clock(interval_s: float) -> Clock:
    """A clock that fits phase and rate of the controller's cycles to the times of receipt.

    A frame is received after it was sent, so it belongs to the last cycle that had begun, unless it was late by more
    than a cycle.  This is ambiguous where cycles seem to be missing: frames were lost, or this machine was stalled and
    the waiting frames arrive in a burst.  Such a frame is held until one arrives at its usual distance; then those that
    arrived together belong to successive cycles, back from the last one, and cycles before them are missing.

    An adapter that passes frames on in bunches, each 16 ms say, makes the last one of a bunch late by anything up to a
    cycle.  Then its time of receipt alone does not determine its cycle: the number of frames does, unless the two
    contradict each other.

    Frames that are not later than the last cycle are rejected as repeated or out of order; those further back than half
    a second (or ten cycles), and those that waited for longer, as untimed.  After a second of nothing but untimed
    frames the line restarts: the clock of this machine was set back.  After a pause of half a second the rate is kept,
    but not the phase; that counts as a restart, too: the clock may have been set forward.

    Args:
        interval_s: the cycle of the controller [s]; a difference of up to about 1000 ppm is found and followed.
    """
    clock = _clock(interval_s, keep=KEEP, most=_MOST, held=1)
    interval_us = clock.state["interval_us"][0]
    clock.state["window_us"], clock.state["step_us"] = WINDOW * interval_us, interval_us / 4
    clock.state["part"], clock.state["quick"] = PART, True
    return clock


def _clock(interval_s: float, keep: int, most: int, held: int) -> Clock:
    state = np.zeros(1, CLOCK)
    new_line(state, interval_s)
    state["keep"], state["most"] = keep, most
    state["longest"] = longest = math.ceil(state["tolerance_us"][0] / state["interval_us"][0])
    return Clock(state, np.zeros((2, held * longest + 3), VALUE))


def counted_interval_s(clock: Clock) -> float | None:
    """Measured time of one count since the first window of the line [s]; None: not known yet."""
    state = clock.state[0]
    passed_us = state["at_us"] - state["first_at_us"]
    if not state["runs"] or passed_us < state["window_us"]:
        return None
    rate = (state["level_us"] - state["first_level_us"]) / passed_us
    return float(state["interval_us"] * (1 + rate) * 1e-6)


def cyclic_interval_s(clock: Clock) -> float | None:
    """The cycle as fitted [s]; None: not known yet."""
    state = clock.state[0]
    if not state["runs"] or state["windows"] <= TELLING:
        return None
    return float(state["interval_us"] * (1 + state["rate"]) * 1e-6)


# --- a counter --------------------------------------------------------------------------------------------------------


@outlined
def count_time(clock: Any, received_us: int, count: float) -> tuple[int, int]:
    """The time [us] of the sample with this count, or why there is none."""
    counted = np.rint(count - clock.offset)
    raw = np.int64(counted if counted < _WRAPS else counted - 2 * _WRAPS)  # only differences count
    if not clock.runs:
        return _anchor_count(clock, received_us, raw), GIVEN
    expected = np.int64(np.rint((received_us - clock.received_us) / clock.interval_us))
    half = clock.modulus // 2
    # Of all numbers that fit the wrapped counter, the most likely by receipt.
    n = clock.n + expected - half + (raw - clock.raw - expected + half) % clock.modulus
    line_us = nominal(clock, n)
    delay_us = received_us - line_us
    counts = n - clock.given_n
    if abs(delay_us - clock.shift_us) > clock.tolerance_us:
        due_us = (n - clock.n) * clock.interval_us
        if (
            0 < counts <= HELD_UP
            and delay_us > clock.shift_us
            and received_us - clock.received_us < due_us / 2
        ):
            clock.off_since_us = received_us  # a backlog, which soon is at the line again
            clock.received_us, clock.raw, clock.n = received_us, raw, n
            clock.given_n = n
            return line_us + clock.shift_us, GIVEN
        if is_given_up(clock, received_us):
            return _anchor_count(clock, received_us, raw), GIVEN
        clock.received_us, clock.raw, clock.n = received_us, raw, n
        return 0, UNTIMED
    if counts <= 0:
        return 0, OUT_OF_ORDER if counts else REPEATED
    clock.is_off = False
    clock.given_n = n
    clock.received_us, clock.raw, clock.n = received_us, raw, n
    place_us = n * clock.interval_us
    see_delay(clock, place_us, float(delay_us))
    shift_us = follow_delay(clock, place_us, counts * clock.interval_us)
    return line_us + shift_us, GIVEN


@outlined
def _anchor_count(clock: Any, received_us: int, raw: Any) -> int:
    begin_line(clock, received_us)
    restart_drift(clock, 0.0)
    clock.runs, clock.given_n = True, 0
    clock.received_us, clock.raw, clock.n = received_us, raw, 0
    return received_us


# --- controllers that send in cycles, without a counter ---------------------------------------------------------------


@outlined
def read_cycle(clock: Any, values: Any, value: Any) -> None:
    """Take the values of a frame; those whose times are known now are in ``ready``, in order.

    Args:
        clock: the record of a cyclic one.
        values: those that wait in it.
        value: a record with the values and the time of receipt.
    """
    received_us = value.received_us
    clock.ready = 0
    if not clock.runs:
        _put_ready(clock, values, value, _anchor_cycle(clock, received_us, 0.0), GIVEN)
        return
    place_us = received_us - clock.anchor_us
    late_us = place_us - expected_delay(clock, float(place_us))
    waited = received_us - clock.received_us < clock.interval_us / 2
    cycle = _last_possible(clock, late_us / clock.interval_us, waited)
    newest = values[HELD, clock.held - 1].cycle if clock.held else clock.n
    if cycle <= newest - clock.longest:
        _read_untimed(clock, values, value)
        return
    if clock.held and not waited and cycle > newest:
        release_held(clock, values)
    if clock.held or cycle > clock.n + 1:
        _hold(clock, values, value, cycle)
        return
    clock.received_us = received_us
    if cycle <= clock.n:
        _put_ready(clock, values, value, 0, REPEATED if cycle == clock.n else OUT_OF_ORDER)
        return
    _put_ready(clock, values, value, _give(clock, received_us, cycle), GIVEN)


@outlined
def _last_possible(clock: Any, late: float, waited: bool) -> Any:
    """The last cycle that a frame can be of; ``late``: after the line at cycle 0, in cycles."""
    clock.bunched += ((1.0 if waited else 0.0) - clock.bunched) / RECENT
    if clock.bunched < BUNCHED:
        return np.int64(math.floor(late + EARLY))
    counted = clock.n + clock.held + 1
    if -COUNTED <= late - counted < 1.0:
        return counted
    return np.int64(math.floor(late + PART))


@outlined
def _put_ready(clock: Any, values: Any, value: Any, time_us: int, reason: int) -> None:
    values[READY, clock.ready] = value
    values[READY, clock.ready].time_us = time_us
    values[READY, clock.ready].reason = reason
    clock.ready += 1


@outlined
def _hold(clock: Any, values: Any, value: Any, cycle: Any) -> None:
    received_us = value.received_us
    if received_us - clock.received_us > clock.tolerance_us:
        clock.paused = True
    clock.received_us = received_us
    clock.is_off = False
    values[HELD, clock.held] = value
    values[HELD, clock.held].cycle = cycle
    clock.held += 1
    if clock.held > clock.longest:
        _put_ready(clock, values, values[HELD, 0], 0, UNTIMED)
        for k in range(1, clock.held):
            values[HELD, k - 1] = values[HELD, k]
        clock.held -= 1


@outlined
def release_held(clock: Any, values: Any) -> None:
    """Frames that arrived together belong to successive cycles; the last one determines its own."""
    count = clock.held
    if count == 0:
        return
    # The cycle that each has; the last one that it can be of stays in the record.
    after = values[HELD, count - 1].cycle + 1
    for k in range(count - 1, -1, -1):
        after = min(values[HELD, k].cycle, after - 1)
        values[HELD, k].time_us = after
    if clock.paused:
        clock.pauses += 1
        clock.paused = False
        last = values[HELD, count - 1]
        place_us = last.time_us * clock.interval_us
        begin_again(clock, place_us)
        delay_us = last.received_us - nominal(clock, last.time_us)
        see_delay(clock, place_us, float(delay_us))
    for k in range(count):
        held = values[HELD, k]
        n = held.time_us
        if n <= clock.n:
            _put_ready(clock, values, held, 0, REPEATED)
        elif n == held.cycle:
            _put_ready(clock, values, held, _give(clock, held.received_us, n), GIVEN)
        else:  # a frame that waited gives no information on the clock
            _put_ready(clock, values, held, _time_of(clock, n), GIVEN)
    clock.held = 0


@outlined
def _give(clock: Any, received_us: int, n: Any) -> Any:
    clock.is_off = False
    delay_us = received_us - nominal(clock, n)
    see_delay(clock, n * clock.interval_us, float(delay_us))
    return _time_of(clock, n)


@outlined
def _time_of(clock: Any, n: int) -> Any:
    passed_us = (n - clock.n) * clock.interval_us
    clock.n = n
    shift_us = follow_delay(clock, n * clock.interval_us, passed_us)
    return nominal(clock, n) + shift_us


@outlined
def _read_untimed(clock: Any, values: Any, value: Any) -> None:
    if not is_given_up(clock, value.received_us):
        _put_ready(clock, values, value, 0, UNTIMED)
        return
    release_held(clock, values)
    _put_ready(clock, values, value, _anchor_cycle(clock, value.received_us, clock.rate), GIVEN)


@outlined
def _anchor_cycle(clock: Any, received_us: int, rate: float) -> int:
    begin_line(clock, received_us)
    restart_drift(clock, rate)
    see_delay(clock, 0.0, 0.0)
    clock.runs = True
    clock.n, clock.received_us = 0, received_us
    return received_us
