"""Some rows of a table of numbers."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Rows(NamedTuple):
    """Columns by name, NaN where a cell is empty; ``done`` is how much of the file has been read, 0 to 1."""

    columns: Mapping[str, Floats]
    done: float
