"""Work arrays of a run, and columns moved between a batch and its lanes.

All is written as loops, and arrays are allocated only here: numpy's broadcasting and constructors, compiled at each
use, would double the time to compile the kernel.
"""

from typing import Any

import numpy as np

from monitor_core.arrays import Floats, Indices, Ints
from monitor_core.kernel.compile import allocating, array_function, kernel, outlined
from monitor_core.kernel.tables import Product


@allocating
def floats(W: int) -> Floats:
    """Zeros (W,)."""
    return np.zeros(W)


@allocating
def ints(W: int) -> Ints:
    """Zeros (W,)."""
    return np.zeros(W, np.int64)


@allocating
def table(rows: int, W: int) -> Floats:
    """Zeros (rows, W)."""
    return np.zeros(rows * W).reshape(rows, W)


@allocating
def flags(rows: int, W: int) -> Ints:
    """Zeros (rows, W)."""
    return np.zeros(rows * W, np.int64).reshape(rows, W)


@array_function
def strided(indices: Indices, W: int) -> Indices:
    """Indices of flat arrays with W numbers a row."""
    out = np.empty_like(indices)
    for q in range(indices.size):
        out[q] = indices[q] * np.uint64(W)
    return out


@array_function
def strided_product(F: Product, p: int, wide: int, W: int) -> Product:
    """The product for ``p`` parameters with indices into arrays of lanes: ``wide`` lanes side by side, W in a row."""
    at_A, more_at, part_at = strided(F.A_at, wide), strided(F.more_at, wide), strided(F.part_at, wide)
    place, slot = strided(F.part_place, wide), strided(F.part_slot, W)
    return Product(
        F.n,
        p,
        F.blocks,
        F.A_start,
        at_A,
        F.more_start,
        more_at,
        F.more_slot,
        F.part_start,
        place,
        part_at,
        slot,
    )


@outlined
def copy_rows(source: Floats, target: Floats) -> None:
    """Copy into the first rows of target."""
    for r in range(source.shape[0]):
        for a in range(source.shape[1]):
            target[r, a] = source[r, a]


@array_function
def take_columns(bank: Any, first: int, W: int) -> Any:
    """A contiguous copy of W columns from ``first`` on; the last column is repeated if there are not enough."""
    out = np.empty((bank.shape[0], W), bank.dtype)
    for r in range(bank.shape[0]):
        for a in range(W):
            out[r, a] = bank[r, min(first + a, bank.shape[1] - 1)]
    return out


@outlined
def put_columns(lanes: Any, bank: Any, first: int) -> None:
    """Put the columns back where ``take_columns`` took them from."""
    for r in range(lanes.shape[0]):
        for a in range(min(lanes.shape[1], bank.shape[1] - first)):
            bank[r, first + a] = lanes[r, a]


@kernel
def any_positive(values: Floats) -> bool:
    """Whether one of the numbers (W,) is above zero."""
    found = False
    for a in range(values.size):
        found |= values[a] > 0.0
    return found


@kernel
def largest(number: Ints, first: int, W: int) -> int:
    """The largest of W numbers from ``first`` on."""
    top = 0
    for a in range(min(W, number.size - first)):
        top = max(top, number[first + a])
    return top
