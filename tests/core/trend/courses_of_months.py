"""Simulated slow histories: a course, and what scatters about it."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.trend.entries import HistoryEntry

HOUR_US = 3_600_000_000
START_US = 1_760_000_000_000_000
SIZE = 0.06


def months(
    rng: np.random.Generator,
    hours: int,
    course: Callable[[Floats], NDArray[np.floating[Any]]],
    white: float = 0.0,
    lasting: float = 0.0,
    for_h: float = 5.0,
    sd: float = 0.0005,
    size: float = SIZE,
    start_us: int = START_US,
) -> list[HistoryEntry]:
    """An entry each hour: ``course`` of the hours, with white and with exponentially correlated scatter.

    The parameter is about ``size``; scatter and sd are for one of 0.06.
    """
    t: Floats = np.arange(0.5, hours)
    a = float(np.exp(-1 / for_h))
    noise = np.empty(hours)
    x = lasting * rng.normal()
    for k in range(hours):
        noise[k] = x
        x = a * x + lasting * np.sqrt(1 - a * a) * rng.normal()
    noise += white * rng.normal(size=hours) + sd * rng.normal(size=hours)
    values = course(t) + noise * size / SIZE
    starts = start_us + np.arange(hours) * HOUR_US
    variance = (sd * size / SIZE) ** 2
    return [
        HistoryEntry(int(s), int(s) + HOUR_US, int(s) + HOUR_US // 2, float(v), variance, 3600.0)
        for s, v in zip(starts, values, strict=True)
    ]
