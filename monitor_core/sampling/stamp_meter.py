"""Scatter of the time stamps of an axis, updated with each frame."""

import math
from typing import Any

import numpy as np

from monitor_core.kernel.compile import outlined

MEMORY = 1000
"""Number of samples over which the scatter is averaged."""

METER = np.dtype(
    [
        ("interval_us", "f8"),
        ("median_us", "f8"),
        ("last_us", "i8"),
        ("runs", "?"),
        ("intervals_count", "i8"),
        ("intervals_mean", "f8"),
        ("intervals_variance", "f8"),
        ("delays_count", "i8"),
        ("delays_mean", "f8"),
        ("delays_variance", "f8"),
    ]
)
"""Median of the intervals; count, mean and variance of the intervals [us], and of receipt minus time of sample [us]."""


def new_meter(interval_s: float) -> Any:
    """A new meter (1,) for this nominal sample interval [s]."""
    meter = np.zeros(1, METER)
    meter["interval_us"] = meter["median_us"] = interval_s * 1e6
    return meter


@outlined
def frame_received(m: Any, t_us: int) -> None:
    """Update the intervals with the time of receipt of a frame."""
    passed_us, runs = t_us - m.last_us, m.runs
    m.last_us, m.runs = t_us, True
    if not runs:
        return
    if 0.5 < passed_us / m.interval_us < 1.5:  # otherwise frames were lost, or a clock was set
        m.intervals_count += 1
        part = 1 / min(m.intervals_count, MEMORY)
        off = passed_us - m.intervals_mean
        m.intervals_mean += part * off
        m.intervals_variance = (1 - part) * (m.intervals_variance + part * off * off)
    if passed_us > 0:
        step_us = m.interval_us * max(0.5 / (m.intervals_count + 1), 1e-5)
        m.median_us += math.copysign(step_us, passed_us - m.median_us)


@outlined
def sample_timed(m: Any, received_us: int, time_us: int) -> None:
    """Update the delays with the time of receipt and the time of a sample."""
    m.delays_count += 1
    part = 1 / min(m.delays_count, MEMORY)
    off = (received_us - time_us) - m.delays_mean
    m.delays_mean += part * off
    m.delays_variance = (1 - part) * (m.delays_variance + part * off * off)
