"""The time of a sample from the cycles of its frames, for controllers that send in cycles without a counter."""

import math
from typing import Any

import numpy as np

from monitor_core.kernel.compile import outlined
from monitor_core.sampling.clock_line import (
    MIN_FIT_WINDOWS,
    add_delay,
    begin_line,
    expected_delay,
    follow_delay,
    must_restart,
    nominal,
    restart_drift,
    resume_line,
    step_line,
)
from monitor_core.sampling.controller_clocks import (
    GIVEN,
    HELD,
    OUT_OF_ORDER,
    READY,
    REPEATED,
    UNTIMED,
    Clock,
    new_clock,
)

WINDOW = 128
"""Cycles in a window, whose early frames determine the line: at 1000 ppm it moves by an eighth of a cycle meanwhile."""

EARLY_SHARE = 0.1
"""Share of the frames that are before the line: the very earliest may be late frames that got the next cycle."""

FIT_WINDOWS = 32
"""Number of windows through which the line is fitted."""

MAX_EARLY_CYCLES = 0.25
"""A frame may be before the line by up to this part of a cycle; an earlier one belongs to the cycle before."""

BUNCHED_SHARE = 0.1
"""From this share of frames that follow another one immediately, frames are taken to come in bunches."""

BUNCHED_MEMORY = 64
"""Number of frames over which that share is averaged."""

MAX_EARLY_COUNTED = 0.4
"""The same limit as ``MAX_EARLY_CYCLES`` for the last frame of a bunch, if the number of frames gives its cycle."""

MIN_SET_BACK = 0.25
"""Part of a cycle: a frame that was received by more than this before the last one shows that the clock was set back.
Jitter does not make it so, as a bus keeps the order of its frames."""

_EARLIEST_KEPT = int(EARLY_SHARE * WINDOW) + 1


def cyclic_clock(interval_s: float) -> Clock:
    """A clock that fits phase and rate of the controller's cycles to the times of receipt.

    A frame is received after it was sent.  So it belongs to the last cycle that had begun, unless it was late by more
    than a cycle.  This is ambiguous where cycles seem to be missing: either frames were lost, or this machine stalled
    and the waiting frames arrive in a burst.  Such frames are held until a frame arrives at the usual distance from the
    one before.  Then the held frames get successive cycles, counted back from the last one; cycles before them are
    missing.

    An adapter that passes frames on in bunches, every 16 ms say, makes the last frame of a bunch late by up to a cycle.
    Then its time of receipt does not determine its cycle; the number of frames does, unless the two contradict each
    other.

    Frames that are not later than the last cycle are rejected as repeated or out of order.  If a frame is received
    before the one before it, and the next one is not later than the last cycle either, then the clock of this machine
    was set back.  The cycles are counted on, and the line follows the new times of receipt slowly, as it does after a
    smaller step; so the samples keep their distances.  This counts as a restart.

    Frames further back than half a second (or ten cycles), and frames that waited for longer than that, are rejected
    as untimed.  After a second of only untimed frames the line restarts.  After a pause of half a second the line keeps
    its rate, but not its phase, as the clock may have been set forward; this counts as a restart too.

    Args:
        interval_s: the cycle of the controller [s]; a difference of up to about 1000 ppm is found and followed.
    """
    clock = new_clock(interval_s, keep=FIT_WINDOWS, most=_EARLIEST_KEPT, held=1)
    interval_us = clock.state["interval_us"][0]
    clock.state["window_us"], clock.state["step_us"] = WINDOW * interval_us, interval_us / 4
    clock.state["part"], clock.state["quick"] = EARLY_SHARE, True
    return clock


def cyclic_interval_s(clock: Clock) -> float | None:
    """Fitted length of the cycle [s]; None: not known yet."""
    state = clock.state[0]
    if not state["runs"] or state["windows"] <= MIN_FIT_WINDOWS:
        return None
    return float(state["interval_us"] * (1 + state["rate"]) * 1e-6)


@outlined
def read_cycle(clock: Any, values: Any, value: Any) -> None:
    """Take the values of a frame; values whose times are now known go to the READY row, in order.

    Args:
        clock: state of a cyclic clock.
        values: its waiting values.
        value: values and time of receipt of the frame.
    """
    received_us = value.received_us
    clock.ready = 0
    if not clock.runs:
        _put_ready(clock, values, value, _anchor_cycle(clock, received_us, 0.0), GIVEN)
        return
    back = clock.received_us - received_us > MIN_SET_BACK * clock.interval_us
    if back:
        release_held(clock, values)  # they were received before the clock was set
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
        _read_earlier(clock, values, value, cycle, back)
        return
    _put_ready(clock, values, value, _assign_cycle(clock, received_us, cycle), GIVEN)


@outlined
def _last_possible(clock: Any, late: float, waited: bool) -> Any:
    """Last cycle that a frame can belong to; ``late``: time of receipt in cycles, from the line at cycle 0."""
    clock.bunched += ((1.0 if waited else 0.0) - clock.bunched) / BUNCHED_MEMORY
    if clock.bunched < BUNCHED_SHARE:
        return np.int64(math.floor(late + MAX_EARLY_CYCLES))
    counted = clock.n + clock.held + 1
    if -MAX_EARLY_COUNTED <= late - counted < 1.0:
        return counted
    return np.int64(math.floor(late + EARLY_SHARE))


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
    """Give the held frames successive cycles, counted back from the cycle of the last one."""
    count = clock.held
    if count == 0:
        return
    # The assigned cycle goes to time_us; ``cycle`` keeps the last one that the frame can belong to.
    after = values[HELD, count - 1].cycle + 1
    for k in range(count - 1, -1, -1):
        after = min(values[HELD, k].cycle, after - 1)
        values[HELD, k].time_us = after
    if clock.paused:
        clock.pauses += 1
        clock.paused = False
        last = values[HELD, count - 1]
        place_us = last.time_us * clock.interval_us
        resume_line(clock, place_us)
        delay_us = last.received_us - nominal(clock, last.time_us)
        add_delay(clock, place_us, float(delay_us))
    for k in range(count):
        held = values[HELD, k]
        n = held.time_us
        if n <= clock.n:
            _put_ready(clock, values, held, 0, REPEATED)
        elif n == held.cycle:
            _put_ready(clock, values, held, _assign_cycle(clock, held.received_us, n), GIVEN)
        else:  # a frame that waited gives no information on the clock
            _put_ready(clock, values, held, _time_of(clock, n), GIVEN)
    clock.held = 0


@outlined
def _assign_cycle(clock: Any, received_us: int, n: Any) -> Any:
    clock.is_off = False
    delay_us = received_us - nominal(clock, n)
    add_delay(clock, n * clock.interval_us, float(delay_us))
    return _time_of(clock, n)


@outlined
def _time_of(clock: Any, n: int) -> Any:
    passed_us = (n - clock.n) * clock.interval_us
    clock.n, clock.set_back = n, False
    shift_us = follow_delay(clock, n * clock.interval_us, passed_us)
    return nominal(clock, n) + shift_us


@outlined
def _read_earlier(clock: Any, values: Any, value: Any, cycle: Any, back: Any) -> None:
    """Take a frame that is not later than the last cycle; ``back``: nor than the frame before."""
    received_us = value.received_us
    if clock.set_back and clock.is_off:  # untimed frames came before, so the cycles have not been counted
        clock.restarts += 1
        _put_ready(clock, values, value, _anchor_cycle(clock, received_us, clock.rate), GIVEN)
        return
    if clock.set_back:  # the second one in a row
        n = clock.n + 2
        # The smaller delay of the two, as one of the frames may be late.
        delay_us = min(clock.set_back_us, float(received_us - nominal(clock, n)))
        step_line(clock, n * clock.interval_us, delay_us)
        clock.restarts += 1
        _put_ready(clock, values, value, _time_of(clock, n), GIVEN)
        return
    if back:
        clock.set_back, clock.set_back_us = True, float(received_us - nominal(clock, clock.n + 1))
    _put_ready(clock, values, value, 0, REPEATED if cycle == clock.n else OUT_OF_ORDER)


@outlined
def _read_untimed(clock: Any, values: Any, value: Any) -> None:
    if not must_restart(clock, value.received_us):
        _put_ready(clock, values, value, 0, UNTIMED)
        return
    release_held(clock, values)
    _put_ready(clock, values, value, _anchor_cycle(clock, value.received_us, clock.rate), GIVEN)


@outlined
def _anchor_cycle(clock: Any, received_us: int, rate: float) -> int:
    begin_line(clock, received_us)
    restart_drift(clock, rate)
    add_delay(clock, 0.0, 0.0)
    clock.runs = True
    clock.n, clock.received_us, clock.set_back = 0, received_us, False
    return received_us
