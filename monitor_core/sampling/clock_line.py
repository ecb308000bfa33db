"""The clock of a controller as seen by this machine: a straight line through times of receipt, which drifts slowly.

Frames are received late, never early.  So the smallest delay of many frames determines the line much better than the
delay of a single frame.
"""

from typing import Any

import numpy as np

from monitor_core.kernel.compile import outlined

SLEW = 150e-6
"""Largest shift of the line per elapsed time: two crystals rarely differ by more than 100 ppm."""

FIRST_SLEW = 0.05
"""The same during the first window, as the frame that started the line may itself have been late."""

MAX_RATE = 2000e-6
"""Largest fitted rate: a larger one means that sample_interval_s is wrong."""

WINDOW_US = 10_000_000
"""Length of a window: its smallest delay shows the drift, while single frames may be late."""

TOLERANCE_US = 0.5e6
"""A frame that is off the line by more than this, and more than ten intervals, does not belong to it."""

PATIENCE_US = 1e6
"""The line restarts after this time (or ten intervals) with only frames that are off the line."""

MIN_FIT_WINDOWS = 8
"""More windows than this determine the rate."""

MAX_WINDOWS, MAX_EARLY = 32, 13
"""Largest number of windows of any clock, and of earliest frames that it keeps in a window"""

LINE_FIELDS: list[tuple[Any, ...]] = [
    ("interval_us", "f8"),  # between two numbers
    ("tolerance_us", "f8"),  # a frame farther off does not belong to the line
    ("patience_us", "f8"),  # time of only such frames after which the line restarts
    ("anchor_us", "i8"),  # time of receipt of the number 0
    ("off_since_us", "i8"),  # first of the latest frames that were all off the line
    ("is_off", "?"),  # whether the last frame was off the line
    ("restarts", "i8"),
]
"""The line gives the time of a sample by its number: whole intervals from the time of an anchor."""

DRIFT_FIELDS: list[tuple[Any, ...]] = [
    # Settings: see below.
    ("window_us", "f8"),  # length of a window
    ("keep", "i8"),
    ("most", "i8"),
    ("part", "f8"),
    ("step_us", "f8"),
    ("quick", "?"),
    # The fit: delay = level_us + rate (place - at_us).
    ("at_us", "f8"),
    ("level_us", "f8"),
    ("rate", "f8"),
    ("known_rate", "f8"),  # with which the fit began
    ("first_at_us", "f8"),
    ("first_level_us", "f8"),
    ("windows", "i8"),  # number of windows in the fit
    ("window", "f8", (MAX_WINDOWS, 2)),  # these: place, smallest delay
    # The present window.
    ("early", "i8"),  # number of early frames that are kept
    ("earliest", "f8", (MAX_EARLY + 1, 3)),  # these: delay beyond the fit, place, delay
    ("seen", "i8"),  # number of frames
    ("window_since_us", "f8"),  # place at which it began
    ("may_move_us", "f8"),  # rest of the change of the shift that is permitted so far
    ("was_off", "?"),  # whether the last window was off by more than step_us
    ("shift_us", "i8"),  # present shift of the line
]
"""Delay of a line relative to its nominal course: a fit through the smallest delays of up to ``keep`` windows.

Two consecutive windows that are off by more than ``step_us`` are a step, and the fit restarts.  The smallest delay of a
window is the quantile ``part`` of its delays, as its very earliest frame may have a wrong number; the ``most`` earliest
frames are kept for that.  ``first_at_us`` and ``first_level_us`` belong to the first window: the frame that started the
line may have been late.  For the same reason, with ``quick`` the line follows early frames immediately during the first
window.
"""


def new_line(clock: Any, interval_s: float) -> None:
    """Set up a line whose consecutive numbers are ``interval_s`` apart."""
    clock["interval_us"] = interval_us = interval_s * 1e6
    clock["tolerance_us"] = max(TOLERANCE_US, 10 * interval_us)
    clock["patience_us"] = max(PATIENCE_US, 10 * interval_us)


@outlined
def begin_line(clock: Any, received_us: int) -> None:
    """Start a line: the sample with number 0 was received at this time."""
    clock.anchor_us = received_us
    clock.is_off = False


@outlined
def nominal(clock: Any, n: int) -> Any:
    """Time [us] of sample number n without the shift: one product, rounded once, so that no error accumulates."""
    return clock.anchor_us + np.int64(np.rint(n * clock.interval_us))


@outlined
def must_restart(clock: Any, received_us: int) -> Any:
    """Note a frame that is off the line; returns whether such frames alone came for so long that the line restarts."""
    if not clock.is_off or received_us < clock.off_since_us:
        clock.off_since_us = received_us
    clock.is_off = True
    restart = received_us - clock.off_since_us >= clock.patience_us
    if restart:
        clock.restarts += 1
    return restart


@outlined
def restart_drift(clock: Any, rate: float) -> None:
    """Start the fit of a new line with this rate, which may be known from the line before."""
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
    """Delay [us] of an early frame at this place of the line: from past windows, or in the first from its frames."""
    fitted_us = _fitted(clock, place_us)
    if clock.windows == 0 and clock.early > 0:
        return fitted_us + clock.earliest[_least(clock), 0]
    return fitted_us


@outlined
def add_delay(clock: Any, place_us: float, delay_us: float) -> None:
    """Add the delay of a frame at this place of the line."""
    over_us = delay_us - _fitted(clock, place_us)
    clock.seen += 1
    n = clock.early
    if n == clock.most and over_us >= clock.earliest[n - 1, 0]:
        return
    k = n
    while k > 0 and _is_before(clock, over_us, place_us, delay_us, k - 1):
        for i in range(3):
            clock.earliest[k, i] = clock.earliest[k - 1, i]
        k -= 1
    clock.earliest[k, 0], clock.earliest[k, 1], clock.earliest[k, 2] = over_us, place_us, delay_us
    clock.early = min(n + 1, clock.most)


@outlined
def _is_before(clock: Any, over_us: float, place_us: float, delay_us: float, k: int) -> Any:
    if over_us != clock.earliest[k, 0]:
        return over_us < clock.earliest[k, 0]
    if place_us != clock.earliest[k, 1]:
        return place_us < clock.earliest[k, 1]
    return delay_us < clock.earliest[k, 2]


@outlined
def follow_delay(clock: Any, place_us: float, passed_us: float) -> Any:
    """Shift [us] of the line at this place; its change is limited by the time since the last call, ``passed_us``."""
    if clock.quick and clock.windows == 0:
        _move(clock, np.rint(expected_delay(clock, place_us)), FIRST_SLEW * passed_us)
        _close_if_full(clock, place_us)
    else:
        _close_if_full(clock, place_us)
        _move(clock, np.rint(_fitted(clock, place_us)), (SLEW + abs(clock.rate)) * passed_us)
    return clock.shift_us


@outlined
def resume_line(clock: Any, place_us: float) -> None:
    """Restart the fit after a pause: the rate is known, the phase of the frames is not."""
    clock.level_us, clock.at_us = _fitted(clock, place_us), place_us
    _discard_windows(clock)
    _next_window(clock, place_us)


@outlined
def step_line(clock: Any, place_us: float, delay_us: float) -> None:
    """Restart the fit with this delay: the clock of receipt was set.  The shift follows as slowly as ever."""
    _discard_windows(clock)
    _next_window(clock, place_us)
    clock.window[0, 0], clock.window[0, 1] = place_us, delay_us
    clock.windows = 1
    clock.was_off = False
    _fit(clock)


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
        _discard_windows(clock)
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
def _discard_windows(clock: Any) -> None:
    clock.windows = 0
    clock.known_rate = clock.rate


@outlined
def _fit(clock: Any) -> None:
    """Fit a line through the delays of the windows.

    A prior keeps the known rate at first: two adjacent windows hardly determine a rate.
    """
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
    clock.rate = max(-MAX_RATE, min(MAX_RATE, rate))


@outlined
def _move(clock: Any, wanted_us: float, most_us: float) -> None:
    error_us = np.int64(wanted_us) - clock.shift_us
    clock.may_move_us += most_us
    step_us = min(abs(error_us), np.int64(clock.may_move_us))
    clock.may_move_us = clock.may_move_us % 1.0  # the fraction of a microsecond is carried over
    clock.shift_us += step_us if error_us > 0 else -step_us
