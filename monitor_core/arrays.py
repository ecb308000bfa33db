"""Names of array types, nothing else."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Indices = NDArray[np.uint64]
"""Unsigned: the compiler need not look for negative indices in the innermost loops."""
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]
