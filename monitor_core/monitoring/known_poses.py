"""The poses of a robot in the calibration records, and whether it is in one of them.

Where the load on an axis follows the angles of several axes, its nominal values hold in the poses of the records;
elsewhere they are an extrapolation.  The ranges of single angles do not show that: two angles may each be within their
range, but never were so together.  So each pair of angles has a map of cells, 10 degrees wide.  A cell is known if a
record was in it or in a neighbour.  Angles are in radians, and equal after a turn.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.samples import SampleBlock

CELLS = 36
"""Cells in a turn"""


class PoseMap(NamedTuple):
    """The known cells of two angles, (CELLS, CELLS); of one angle alone, both are the same."""

    angles: tuple[str, str]
    cells: Bools

    def holds(self, first: Floats, second: Floats) -> Bools:
        """Whether the cells of two angles (N,) are known (N,); of unknown angles (NaN) they are."""
        there = np.isfinite(first) & np.isfinite(second)
        found = np.ones(there.shape, np.bool_)
        found[there] = self.cells[_cells(first[there]), _cells(second[there])]
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
        if bits.size * 8 != CELLS * CELLS:
            raise ValueError(f"{len(digits)} hexadecimal digits: need {CELLS * CELLS // 4}")
        return cls(angles, np.unpackbits(bits).astype(np.bool_).reshape(CELLS, CELLS))


def pose_maps(angles: Sequence[str], signals: Sequence[str], records: Sequence[SampleBlock]) -> Iterator[PoseMap]:
    """A map of each pair of angles in records.

    ``signals``: names of the columns of the records' signals, among them the angles.
    """
    known = [record.signals for record in records if record.signals is not None]
    if not known:
        return
    for pair in combinations(angles, 2) if len(angles) > 1 else [(name, name) for name in angles]:
        cells = np.zeros((CELLS, CELLS), np.bool_)
        columns = [signals.index(name) for name in pair]
        for values in known:
            first, second = values[:, columns].T
            there = np.isfinite(first) & np.isfinite(second)
            cells[_cells(first[there]), _cells(second[there])] = True
        rows = cells | np.roll(cells, 1, 0) | np.roll(cells, -1, 0)
        yield PoseMap(pair, rows | np.roll(rows, 1, 1) | np.roll(rows, -1, 1))


def _cells(angle: Floats) -> NDArray[np.int64]:
    return np.asarray(np.floor(angle * (CELLS / math.tau)), np.int64) % CELLS
