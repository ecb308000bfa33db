"""Work arrays of a run, made in Python: to make them in the kernel would add a tenth to the time to compile it.

None overlaps with another one, which the compiler is told (``run`` in block.py); so none may be in here twice.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.kernel.llvm_vectors import EIGHT
from monitor_core.kernel.tables import Product, Tables
from monitor_core.kernel.taylor_series import SECTIONS


class Buffers(NamedTuple):
    """Zeros; W lanes side by side."""

    C: Floats  # the columns of the lanes: constants
    F: Floats  # state, floats
    I: NDArray[np.int64]  # state, integers
    X: Floats  # ((p + 1) n, W)
    G: Floats  # ((p + 1) n, W)
    V: Floats  # (slots + 1, W)
    series: Floats
    more: Floats
    K: Floats  # (n, W)
    du: Floats  # (p, m, W)
    inputs: tuple[Floats, Floats, Floats]  # (m, W) each
    parameters: tuple[Floats, Floats, Floats, Floats, Floats]  # (p, W) each
    tested: NDArray[np.int64]  # (p, W)
    squares: tuple[Floats, Floats, Floats]  # (p, p) each
    numbers: tuple[Floats, ...]  # (W,) each, 15 of them
    counts: tuple[NDArray[np.int64], ...]  # (W,) each, 11 of them


def make_buffers(t: Tables, rows: tuple[int, int, int], W: int) -> Buffers:
    """For W lanes; ``rows``: of C, F, I."""
    n, p, m, wide = t.n, t.p, t.m, 1 if W == 1 else EIGHT
    constants, floats, ints = rows
    return Buffers(
        np.zeros((constants, W)), np.zeros((floats, W)), np.zeros((ints, W), np.int64),
        np.zeros(((p + 1) * n, W)), np.zeros(((p + 1) * n, W)), np.zeros((t.slots + 1, W)),
        np.zeros(SECTIONS * n * t.product.blocks * wide), np.zeros(max(t.product.more_slot.size, 4 * wide)),
        np.zeros((n, W)), np.zeros((p, m, W)), _several(3, m, W), _several(5, p, W),
        np.zeros((p, W), np.int64), _several(3, p, p), _several(15, W),
        _several(11, W, of_type=np.int64),
    )  # fmt: skip


def _several(number: int, *shape: int, of_type: type = float) -> Any:
    """So many arrays of that shape."""
    return tuple(np.zeros((number, *shape), of_type))


def product_of_lanes(F: Product, W: int) -> Product:
    """The product with indices into arrays of W lanes in a row, eight of them side by side; one lane: as it is."""
    if W == 1:
        return F
    wide, lanes = np.uint64(EIGHT), np.uint64(W)
    return F._replace(
        A_at=F.A_at * wide,
        more_at=F.more_at * wide,
        part_place=F.part_place * wide,
        part_at=F.part_at * wide,
        part_slot=F.part_slot * lanes,
    )
