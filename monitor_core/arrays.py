"""Names of array types, and the way from an array to a value that may be unknown."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Indices = NDArray[np.uint64]
"""Unsigned, so that the compiler does not check for negative indices in the innermost loops."""
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]
Arrays = dict[str, NDArray[np.generic]]
"""Arrays by name, as a saved state has them."""


def finite(value: float | None) -> float | None:
    """The number, or None if it is not finite: unknown is NaN in arrays, None in values."""
    return value if value is not None and math.isfinite(value) else None
