"""The time of a sample from a sample counter on the bus: a straight line that slowly follows the times of receipt."""

import math
from typing import Any

import numpy as np

from monitor_core.kernel.compile import outlined
from monitor_core.sampling.clock_line import (
    WINDOW_US,
    add_delay,
    begin_line,
    follow_delay,
    must_restart,
    nominal,
    restart_drift,
)
from monitor_core.sampling.controller_clocks import GIVEN, OUT_OF_ORDER, REPEATED, UNTIMED, Clock, new_clock

MIN_COUNTS = 1000
"""From this number of counts on, their mean time is known to 1 % even if a frame comes ten intervals late."""

MAX_BACKLOG_COUNTS = 10
"""A frame soon after another one belongs to a backlog if its count is at most this much beyond the last one."""

_LONGEST_COUNTER = 62
"""Length in bits: a longer counter never wraps."""

_WRAPS = 2.0**63


def counter_clock(interval_s: float, bits: int, offset: float = 0.0) -> Clock:
    """A clock that unwraps a sample counter: a straight line that slowly follows the times of receipt.

    The crystals of the controller and of this machine differ.  So the line is shifted, by at most 150 ppm of the
    elapsed time, towards the smallest recent delay.  Frames that are off the line by more than half a second (or ten
    intervals) are rejected as untimed.  After a second (or ten intervals) with only such frames the line restarts: a
    clock was set, or the controller was restarted.  If a host, a gateway or a sender stalled, its frames come in a
    burst of consecutive counts; only the first frame of that burst is untimed.

    Args:
        interval_s: the time of one count [s].
        bits: length of the counter; it wraps at 2^bits.
        offset: offset of the counter values.
    """
    clock = new_clock(interval_s, keep=1, most=1, held=0)
    clock.state["offset"] = offset
    clock.state["modulus"] = 1 << min(bits, _LONGEST_COUNTER)
    clock.state["window_us"], clock.state["step_us"] = WINDOW_US, math.inf
    return clock


def counted_interval_s(clock: Clock) -> float | None:
    """Time of one count [s], measured since the first window of the line; None: not known yet."""
    state = clock.state[0]
    passed_us = state["at_us"] - state["first_at_us"]
    if not state["runs"] or passed_us < state["window_us"]:
        return None
    rate = (state["level_us"] - state["first_level_us"]) / passed_us
    return float(state["interval_us"] * (1 + rate) * 1e-6)


def time_per_count_s(clock: Clock) -> float | None:
    """Time of receipt per count [s] since the line began; None: too few counts, so that late frames would matter."""
    state = clock.state[0]
    if not state["runs"] or state["n"] < MIN_COUNTS:
        return None
    return float((state["received_us"] - state["anchor_us"]) / state["n"] * 1e-6)


@outlined
def count_time(clock: Any, received_us: int, count: float) -> tuple[int, int]:
    """Time [us] of the sample with this count and GIVEN, or 0 and the reason why it has none."""
    counted = np.rint(count - clock.offset)
    raw = np.int64(counted if counted < _WRAPS else counted - 2 * _WRAPS)  # only differences count
    if not clock.runs:
        return _anchor_count(clock, received_us, raw), GIVEN
    expected = np.int64(np.rint((received_us - clock.received_us) / clock.interval_us))
    half = clock.modulus // 2
    # The sample number that fits the wrapped counter and is nearest to the time of receipt.
    n = clock.n + expected - half + (raw - clock.raw - expected + half) % clock.modulus
    line_us = nominal(clock, n)
    delay_us = received_us - line_us
    counts = n - clock.given_n
    if abs(delay_us - clock.shift_us) > clock.tolerance_us:
        due_us = (n - clock.n) * clock.interval_us
        if (
            0 < counts <= MAX_BACKLOG_COUNTS
            and delay_us > clock.shift_us
            and received_us - clock.received_us < due_us / 2
        ):
            clock.off_since_us = received_us  # a backlog: its frames soon are on the line again
            clock.received_us, clock.raw, clock.n = received_us, raw, n
            clock.given_n = n
            return line_us + clock.shift_us, GIVEN
        if must_restart(clock, received_us):
            return _anchor_count(clock, received_us, raw), GIVEN
        clock.received_us, clock.raw, clock.n = received_us, raw, n
        return 0, UNTIMED
    if counts <= 0:
        return 0, OUT_OF_ORDER if counts else REPEATED
    clock.is_off = False
    clock.given_n = n
    clock.received_us, clock.raw, clock.n = received_us, raw, n
    place_us = n * clock.interval_us
    add_delay(clock, place_us, float(delay_us))
    shift_us = follow_delay(clock, place_us, counts * clock.interval_us)
    return line_us + shift_us, GIVEN


@outlined
def _anchor_count(clock: Any, received_us: int, raw: Any) -> int:
    begin_line(clock, received_us)
    restart_drift(clock, 0.0)
    clock.runs, clock.given_n = True, 0
    clock.received_us, clock.raw, clock.n = received_us, raw, 0
    return received_us
