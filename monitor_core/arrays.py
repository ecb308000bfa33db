"""Names of array types, nothing else."""

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
