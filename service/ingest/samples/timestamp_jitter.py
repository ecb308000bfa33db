"""Jitter of the time stamps of an axis, and recommendations for its configuration."""

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.wording import Sentence, sentence

ClockKind = Literal["receipt", "cyclic", "counter"]

_MIN_INTERVALS = 100
_MIN_INTERVALS_FOR_MEDIAN = 1000
_MAX_SCATTER = 0.05
"""Share of an interval above which scatter is reported: with 0.25 ms at 5 ms, estimates of fm scatter by 2 %."""
_MAX_CLOCK_DIFFERENCE = 300e-6
"""Largest relative difference of two quartz clocks."""


class Stamps(NamedTuple):
    """Quality of the time stamps of an axis.

    ``scatter_s``: standard deviation of the time of receipt minus the time of the sample [s].  With the clock
    "receipt", in which these are equal: the standard deviation of the intervals divided by sqrt(2), as for independent
    errors.  ``interval_s``: interval of the controller, measured by the clock of this machine [s].  None: not known
    yet.  ``interval_from``: whether the clock of the samples' times has fitted that interval, or it is the median of
    the measured intervals.  ``intervals_scatter_s``: scatter of these, which limits the accuracy of their median [s];
    None: it is ``scatter_s``.
    """

    clock: ClockKind
    scatter_s: float | None
    interval_s: float | None
    interval_from: Literal["clock", "median"] = "clock"
    intervals_scatter_s: float | None = None


NOT_KNOWN = Stamps("receipt", None, None)


def stamps_of(
    meter: NDArray[np.void], clock: ClockKind, fitted_s: float | None = None, counted_s: float | None = None
) -> Stamps:
    """The results so far of a meter of ``monitor_core.sampling.new_meter``.

    ``clock``: clock of the samples' times; ``fitted_s``: interval that this clock has fitted [s]; ``counted_s``: time
    of receipt per count of a sample counter [s].
    """
    m = meter[0]
    known = {name: m[f"{name}_count"] >= _MIN_INTERVALS for name in ("intervals", "delays")}
    between_s = math.sqrt(0.5 * m["intervals_variance"]) * 1e-6 if known["intervals"] else None
    late_s = math.sqrt(m["delays_variance"]) * 1e-6 if known["delays"] else None
    scatter_s = between_s if clock == "receipt" else late_s
    if m["intervals_count"] < _MIN_INTERVALS_FOR_MEDIAN:
        return Stamps(clock, scatter_s, fitted_s)
    measured_s, nominal_s = float(m["median_us"]) * 1e-6, float(m["interval_us"]) * 1e-6
    if counted_s is not None and abs(counted_s - nominal_s) < abs(measured_s - nominal_s):
        # Late frames that catch up shorten most intervals, but not all of them together.
        measured_s = counted_s
    # With a wrong nominal interval, samples that are timed by a counter drift away from their times of receipt.  This
    # drift is no scatter, so the scatter of the intervals is used instead.
    intervals_scatter_s = between_s if clock == "counter" else None
    # Use the interval of the fitted clock, unless the nominal interval is too far off for the fit to work.
    if fitted_s is None or _far_off(
        measured_s, nominal_s, scatter_s if intervals_scatter_s is None else intervals_scatter_s
    ):
        return Stamps(clock, scatter_s, measured_s, "median", intervals_scatter_s)
    return Stamps(clock, scatter_s, fitted_s)


def remarks(interval_s: float, stamps: Stamps) -> Iterator[Sentence]:
    """Recommendations for the configuration of an axis; ``interval_s``: its nominal interval [s]."""
    scatter_s, found_s = stamps.scatter_s, stamps.interval_s
    if stamps.clock == "receipt" and scatter_s is not None and scatter_s > _MAX_SCATTER * interval_s:
        yield sentence(
            "stamps scatter",
            "stamps scatter by {scatter}: if the controller samples on its own clock, set "
            'clock = "cyclic" in [robot.axis.time], or counter_message and counter_signal if it sends a counter',
            scatter=_ms(scatter_s),
        )
    if found_s is None:
        return
    fitted = stamps.interval_from == "clock"
    by_clock = fitted and abs(found_s / interval_s - 1) > _MAX_CLOCK_DIFFERENCE
    if by_clock or _far_off(found_s, interval_s, stamps.intervals_scatter_s or scatter_s):
        yield sentence(
            "interval differs",
            "a sample comes every {found} ms, not every {interval} ms: correct sample_interval_s",
            found=f"{1e3 * found_s:.5g}",
            interval=f"{1e3 * interval_s:g}",
        )


def _far_off(found_s: float, interval_s: float, scatter_s: float | None) -> bool:
    """Whether the median of the intervals differs significantly from the nominal one.

    The median of a thousand intervals has a standard error of 1/25 of their standard deviation.
    """
    least_s = max(0.01 * interval_s, 0.2 * (scatter_s or 0.0))
    return abs(found_s - interval_s) > least_s


def in_words(stamps: Stamps) -> tuple[str, str]:
    """The jitter and the interval in words."""
    found_s = stamps.interval_s
    return _ms(stamps.scatter_s), "" if found_s is None else f"every {1e3 * found_s:.5g} ms"


def _ms(seconds: float | None) -> str:
    return "nothing yet" if seconds is None else f"{1e3 * seconds:.2g} ms"
