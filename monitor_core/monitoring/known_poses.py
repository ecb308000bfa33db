"""The poses of a robot in the calibration records, and whether it is in one of them.

Where the load on an axis follows the angles of several axes, its nominal values hold in the poses of the records;
elsewhere they are an extrapolation.  The ranges of single angles do not show that: two angles may each be within their
range, but never were so together.  So each pair of angles has a map of cells.  A cell is known if a record was in it or
in a neighbour.  Cells are 5 degrees wide where records repeat their poses, as a program does, otherwise 10 degrees.
Angles are in radians, and equal after a turn.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.samples import SampleBlock

FINE, COARSE = 72, 36
"""Cells in a turn"""
_MOST_NOT_REPEATED = 0.05
"""Largest share of the second halves of records in new poses, by the first halves, for the fine cells"""


class PoseMap(NamedTuple):
    """The known cells of two angles, (n, n) for n cells in a turn; of one angle alone, both are the same."""

    angles: tuple[str, str]
    cells: Bools

    def holds(self, first: Floats, second: Floats) -> Bools:
        """Whether the cells of two angles (N,) are known (N,); of unknown angles (NaN) they are."""
        there = np.isfinite(first) & np.isfinite(second)
        found = np.ones(there.shape, np.bool_)
        found[there] = self.cells[_cells(np.array([first[there], second[there]]), len(self.cells))]
        return found

    def to_hex(self) -> str:
        """The cells as hexadecimal digits, one after the other."""
        return np.packbits(self.cells).tobytes().hex()

    @classmethod
    def from_hex(cls, angles: tuple[str, str], digits: str) -> "PoseMap":
        """The map with these cells.

        Raises:
            ValueError: these are no digits of a map.
        """
        bits = np.frombuffer(bytes.fromhex(digits), np.uint8)
        n = math.isqrt(8 * bits.size)
        if n not in (FINE, COARSE) or n * n != 8 * bits.size:
            raise ValueError(f"{len(digits)} hexadecimal digits: need {COARSE**2 // 4} or {FINE**2 // 4}")
        return cls(angles, np.unpackbits(bits).astype(np.bool_).reshape(n, n))


def pose_maps(angles: Sequence[str], signals: Sequence[str], records: Sequence[SampleBlock]) -> Iterator[PoseMap]:
    """A map of each pair of angles in records.

    ``signals``: names of the columns of the records' signals, among them the angles.
    """
    every = [record.signals for record in records if record.signals is not None]
    if not every:
        return
    for pair in combinations(angles, 2) if len(angles) > 1 else [(name, name) for name in angles]:
        columns = [signals.index(name) for name in pair]
        angles_of = [values[:, columns] for values in every]
        poses = [values[np.isfinite(values).all(axis=1)].T for values in angles_of]
        yield PoseMap(pair, _known(poses, FINE if _repeat(poses) else COARSE))


def _known(poses: Sequence[Floats], n: int) -> Bools:
    """The cells (n, n) of pairs of angles (2, N) in records, and their neighbours."""
    cells = np.zeros((n, n), np.bool_)
    for pose in poses:
        cells[_cells(pose, n)] = True
    rows = cells | np.roll(cells, 1, 0) | np.roll(cells, -1, 0)
    return np.asarray(rows | np.roll(rows, 1, 1) | np.roll(rows, -1, 1))


def _repeat(poses: Sequence[Floats]) -> bool:
    """Whether pairs of angles (2, N) in records come again: the second halves are in fine cells of the first."""
    first = _known([pose[:, : pose.shape[1] // 2] for pose in poses], FINE)
    later = np.concatenate([first[_cells(pose[:, pose.shape[1] // 2 :], FINE)] for pose in poses])
    return bool(later.size and np.mean(~later) <= _MOST_NOT_REPEATED)


def _cells(pose: Floats, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (N,) of the cells of pairs of angles (2, N)."""
    first, second = np.asarray(np.floor(pose * (n / math.tau)), np.int64) % n
    return first, second
