"""Stated rates of false alarms beside counted ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from monitor_core.arrays import Floats

CALIBRATIONS = 100
HELD = (83, 96)
"""Of 100 intervals of 90 %, so many hold the truth."""
SAMPLES = 120_000
"""Of a record: ten minutes."""
HOUR = 720_000
BUDGETS = (HOUR // 6, HOUR)


class Stated(Protocol):
    """False alarms per sample: most likely, and the bounds of the 90 % interval."""

    @property
    def total(self) -> float: ...
    @property
    def lower(self) -> float: ...
    @property
    def upper(self) -> float: ...


def kept(words: str, budget: int, stated: Sequence[Stated], true: Floats) -> bool:
    """Whether intervals hold the true rates (CALIBRATIONS,) as often as they say, and the budget is kept; printed."""
    held = sum(r.lower <= t <= r.upper for r, t in zip(stated, true, strict=True))
    within = int((true * budget <= 1).sum())
    width = np.median([np.log(r.upper / r.lower) for r in stated])
    off = np.log([r.total / t for r, t in zip(stated, true, strict=True)])
    print(
        f"\n{words}, budget one in {budget / HOUR:.3g} h: interval holds the truth in {held}, budget kept in {within}"
        f" of {len(stated)}; the interval spans a factor of {np.exp(width):.2f}, the logarithm of the rate is off by"
        f" {off.mean():+.3f} +- {off.std():.3f}",
        flush=True,
    )
    return HELD[0] <= held <= HELD[1] and within >= HELD[0]
