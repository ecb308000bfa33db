"""The clock of a controller as seen by this machine: a straight line through the times of receipt, followed slowly.

Frames are received late, never early: the smallest delay of many frames determines the line much better than any single
one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from monitor_core.kernel.compile import outlined

SLEW = 150e-6
"""How fast sample times follow the receipt: two crystals rarely differ by more than 100 ppm."""

QUICK = 0.05
"""The same while the line has just begun, with a frame that may have been late itself."""

MOST_RATE = 2000e-6
"""A fit that finds more than that is none: sample_interval_s is wrong."""

WINDOW_US = 10_000_000
"""The least delay of receipt within so long shows the drift: single frames may be late."""

TOLERANCE_US = 0.5e6
"""A frame further off the line than this, and than ten intervals, does not belong to it."""

PATIENCE_US = 1e6
"""After so long (or ten intervals) of nothing else the line restarts."""

TELLING = 8
"""Windows that determine the rate."""

MOST_WINDOWS, MOST_EARLY = 32, 13
"""Most windows of any clock, and most earliest frames that it keeps of one"""

LINE_FIELDS: list[tuple[Any, ...]] = [
    ("interval_us", "f8"),
    ("tolerance_us", "f8"),
    ("patience_us", "f8"),
    ("anchor_us", "i8"),
    ("off_since_us", "i8"),
    ("is_off", "?"),
    ("restarts", "i8"),
]
"""Times of samples by their number: whole intervals from an anchor."""

DRIFT_FIELDS: list[tuple[Any, ...]] = [
    # Settings.
    ("window_us", "f8"),
    ("keep", "i8"),
    ("most", "i8"),
    ("part", "f8"),
    ("step_us", "f8"),
    ("quick", "?"),
    # The fit, its windows (place, delay), the early frames of this window (over the fit, place, delay), and the shift.
    ("at_us", "f8"),
    ("level_us", "f8"),
    ("rate", "f8"),
    ("known_rate", "f8"),
    ("first_at_us", "f8"),
    ("first_level_us", "f8"),
    ("windows", "i8"),
    ("window", "f8", (MOST_WINDOWS, 2)),
    ("early", "i8"),
    ("earliest", "f8", (MOST_EARLY + 1, 3)),
    ("seen", "i8"),
    ("window_since_us", "f8"),
    ("may_move_us", "f8"),
    ("was_off", "?"),
    ("shift_us", "i8"),
]
"""Delay of a line relative to its nominal course: the least of each window, or a fit through ``keep`` windows.

Two consecutive windows that are off by more than ``step_us`` are a step, and the fit restarts.  Of the ``most``
earliest frames of a window that quantile counts which is ``part`` of all frames: the very earliest may have a wrong
number.
``first_at_us`` and ``first_level_us`` are of the first of them: the frame that a line begins with may have been late.
With ``quick`` the line first follows early frames immediately, as the one it began with may have been late.
"""


def new_line(clock: Any, interval_s: float) -> None:
    """A line with that interval [s] from one number to the next."""
    clock["interval_us"] = interval_us = interval_s * 1e6
    clock["tolerance_us"] = max(TOLERANCE_US, 10 * interval_us)
    clock["patience_us"] = max(PATIENCE_US, 10 * interval_us)


@outlined
def begin_line(clock: Any, received_us: int) -> None:
    """Begin a line on which the sample with number 0 was received at that time."""
    clock.anchor_us = received_us
    clock.is_off = False


@outlined
def nominal(clock: Any, n: int) -> Any:
    """The time [us] of that number without any shift: one product, rounded once, so that no error accumulates."""
    return clock.anchor_us + np.int64(np.rint(n * clock.interval_us))


@outlined
def is_given_up(clock: Any, received_us: int) -> Any:
    """A frame does not fit; returns whether nothing else has come for so long that the line must restart."""
    if not clock.is_off or received_us < clock.off_since_us:
        clock.off_since_us = received_us
    clock.is_off = True
    given_up = received_us - clock.off_since_us >= clock.patience_us
    if given_up:
        clock.restarts += 1
    return given_up


@outlined
def restart_drift(clock: Any, rate: float) -> None:
    """A new line, whose rate may be known from before."""
    clock.at_us = clock.level_us = clock.window_since_us = clock.may_move_us = 0.0
    clock.first_at_us = clock.first_level_us = 0.0
    clock.rate = clock.known_rate = rate
    clock.windows = clock.early = clock.seen = clock.shift_us = 0
    clock.was_off = False


@outlined
def _fitted(clock: Any, place_us: float) -> Any:
    return clock.level_us + clock.rate * (place_us - clock.at_us)


@outlined
def _least(clock: Any) -> Any:
    return min(clock.early - 1, np.int64(clock.part * clock.seen))


@outlined
def expected_delay(clock: Any, place_us: float) -> Any:
    """The delay [us] of an early frame at that place of the line: by the windows before, at first by the frames."""
    fitted_us = _fitted(clock, place_us)
    if clock.windows == 0 and clock.early > 0:
        return fitted_us + clock.earliest[_least(clock), 0]
    return fitted_us


@outlined
def see_delay(clock: Any, place_us: float, delay_us: float) -> None:
    """Add a frame at that place of the line with that delay."""
    over_us = delay_us - _fitted(clock, place_us)
    clock.seen += 1
    n = clock.early
    if n == clock.most and over_us >= clock.earliest[n - 1, 0]:
        return
    k = n
    while k > 0 and _is_before(clock, over_us, place_us, delay_us, k - 1):
        clock.earliest[k, 0], clock.earliest[k, 1], clock.earliest[k, 2] = (
            clock.earliest[k - 1, 0],
            clock.earliest[k - 1, 1],
            clock.earliest[k - 1, 2],
        )
        k -= 1
    clock.earliest[k, 0], clock.earliest[k, 1], clock.earliest[k, 2] = over_us, place_us, delay_us
    clock.early = min(n + 1, clock.most)


@outlined
def _is_before(clock: Any, over_us: float, place_us: float, delay_us: float, k: int) -> Any:
    if over_us != clock.earliest[k, 0]:
        return over_us < clock.earliest[k, 0]
    return (
        place_us < clock.earliest[k, 1]
        if place_us != clock.earliest[k, 1]
        else delay_us < clock.earliest[k, 2]
    )


@outlined
def follow_delay(clock: Any, place_us: float, passed_us: float) -> Any:
    """The shift [us] of the line at that place, which is limited from the last one on."""
    if clock.quick and clock.windows == 0:
        _move(clock, np.rint(expected_delay(clock, place_us)), QUICK * passed_us)
        _close_if_full(clock, place_us)
    else:
        _close_if_full(clock, place_us)
        _move(clock, np.rint(_fitted(clock, place_us)), (SLEW + abs(clock.rate)) * passed_us)
    return clock.shift_us


@outlined
def begin_again(clock: Any, place_us: float) -> None:
    """Begin a line after a pause: the rate is known, the phase of the frames is not."""
    clock.level_us, clock.at_us = _fitted(clock, place_us), place_us
    _forget(clock)
    _next_window(clock, place_us)


@outlined
def _close_if_full(clock: Any, now_us: float) -> None:
    if now_us - clock.window_since_us < clock.window_us or clock.early == 0:
        return
    least = _least(clock)
    over_us, place_us, delay_us = clock.earliest[least, 0], clock.earliest[least, 1], clock.earliest[least, 2]
    _next_window(clock, now_us)
    if clock.windows > 0 and abs(over_us) > clock.step_us:
        if not clock.was_off:
            clock.was_off = True  # this machine may have been stalled
            return
        _forget(clock)
    clock.was_off = False
    if clock.windows == clock.keep:
        for k in range(1, clock.keep):
            clock.window[k - 1, 0], clock.window[k - 1, 1] = clock.window[k, 0], clock.window[k, 1]
        clock.windows -= 1
    clock.window[clock.windows, 0], clock.window[clock.windows, 1] = place_us, delay_us
    clock.windows += 1
    _fit(clock)


@outlined
def _next_window(clock: Any, since_us: float) -> None:
    clock.early = clock.seen = 0
    clock.window_since_us = since_us


@outlined
def _forget(clock: Any) -> None:
    clock.windows = 0
    clock.known_rate = clock.rate


@outlined
def _fit(clock: Any) -> None:
    """A line through the delays; two windows that are side by side say next to nothing of the rate."""
    count, place_us, delay_us = clock.windows, 0.0, 0.0
    for k in range(count):
        place_us += clock.window[k, 0]
        delay_us += clock.window[k, 1]
    clock.at_us, clock.level_us = place_us / count, delay_us / count
    if clock.first_at_us == 0.0:
        clock.first_at_us, clock.first_level_us = clock.at_us, clock.level_us
    if count == 1:
        return
    known = (clock.window_us / 4) ** 2
    products, squares = 0.0, 0.0
    for k in range(count):
        place_us, delay_us = clock.window[k, 0] - clock.at_us, clock.window[k, 1] - clock.level_us
        products += place_us * delay_us
        squares += place_us * place_us
    rate = (products + known * clock.known_rate) / (squares + known)
    clock.rate = max(-MOST_RATE, min(MOST_RATE, rate))


@outlined
def _move(clock: Any, wanted_us: float, most_us: float) -> None:
    error_us = np.int64(wanted_us) - clock.shift_us
    clock.may_move_us += most_us
    step_us = min(abs(error_us), np.int64(clock.may_move_us))
    clock.may_move_us = clock.may_move_us % 1.0  # the fraction of a microsecond is carried over
    clock.shift_us += step_us if error_us > 0 else -step_us
