"""Short stretches of a record, of which the least and the largest values are kept."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

Counts = NDArray[np.int64]
_T = TypeVar("_T", bound=np.generic)


def known(values: Floats) -> Floats:
    """A copy, NaN where a bin has had no value."""
    copy = values.copy()
    copy[~np.isfinite(copy)] = np.nan
    return copy


def zigzag(t: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """A line through the least and the largest value of each bin, at its time; down one, up the next."""
    both = np.stack([low, high], axis=1)
    both[1::2] = both[1::2, ::-1]
    return np.repeat(t, 2), both.ravel()


def joined(values: NDArray[_T], join: np.ufunc, empty: float) -> NDArray[_T]:
    """Neighbours along the last axis joined in its first half, the second one empty."""
    half = values.shape[-1] // 2
    out = np.full_like(values, empty)
    out[..., :half] = join(values[..., : 2 * half : 2], values[..., 1 : 2 * half : 2])
    return out
