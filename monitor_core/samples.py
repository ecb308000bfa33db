"""Block of samples of one axis, forward fill of slow signals, and physical limits of measured values."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

PHYSICAL_LIMITS: Mapping[str, float] = {"torque": 1e6, "speed": 1e5, "angle": 1e8}
"""Largest magnitudes [N m, rad/s, rad]; a larger value comes from a damaged frame or file.  A ship's propeller has 1e6
N m; 1e5 rad/s is a million revolutions per minute; 1e8 rad is 16 million revolutions."""


class SampleBlock(NamedTuple):
    """Samples of one axis in the order of their receipt: from the reader to the kernel, live or from a record.

    ``t_us`` (N,) times [us]; ``u`` (N,) motor torque [N m]; ``y`` (N,) motor speed [rad/s] or motor angle [rad], as the
    output of the drive.  The other arrays are computed by ``Operating.conditioned`` where an axis has conditions.
    """

    t_us: NDArray[np.int64]  # (N,) time [us]
    u: Floats  # (N,) motor torque [N m]
    y: Floats  # (N,) motor speed [rad/s], or motor angle [rad]
    shift: Floats | None = None
    """(N, p) theta_0(s) - theta_0, where nominal values depend on conditions; NaN: unknown; None: unchanged"""
    gate: NDArray[np.bool_] | None = None
    """(N,) False where the estimates must not be updated; None: all samples are used"""
    weight: Floats | None = None
    """(N,) torque of the nominal weight in the present pose [N m], for drives with that input; NaN: unknown"""
    signals: Floats | None = None
    """(N, S) auxiliary signals, from which shift and gate are computed; NaN: unknown; None: the axis needs none"""
    inside: NDArray[np.bool_] | None = None
    """(N,) True where the conditions are within the calibrated ranges; None: not known"""
    name: str = ""
    """Name of the record, as shown to the user"""

    @property
    def size(self) -> int:
        """Number of samples N."""
        return len(self.t_us)

    def select(self, samples: slice | NDArray[Any]) -> "SampleBlock":
        """A block with only the selected samples: a slice, indices or a mask (N,)."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        return self._replace(**{name: a[samples] for name, a in arrays.items() if a is not None})


_ARRAYS = SampleBlock._fields[:-1]


def concatenate(blocks: Sequence[SampleBlock]) -> SampleBlock:
    """Join blocks of the same axis.  The result has the first block's name; an array that one block lacks is None."""
    if not blocks:
        return SampleBlock(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    if len(blocks) == 1:
        return blocks[0]
    joined = dict[str, NDArray[Any] | None]()
    for name in _ARRAYS:
        parts = [getattr(block, name) for block in blocks]
        joined[name] = None if any(part is None for part in parts) else np.concatenate(parts)
    return blocks[0]._replace(**joined)  # type: ignore[arg-type]


def joined_where_continued(blocks: Sequence[SampleBlock], longest_us: float) -> list[SampleBlock]:
    """Join each block to the one before if it begins at most ``longest_us`` after its end [us].

    A recorder may begin another file each minute.  What is joined has the name of its first block.
    """
    groups = list[list[SampleBlock]]()
    for block in blocks:
        if groups and 0 < int(block.t_us[0]) - int(groups[-1][-1].t_us[-1]) <= longest_us:
            groups[-1].append(block)
        else:
            groups.append([block])
    return [concatenate(group) for group in groups]


def forward_fill(values: Floats, before: Floats) -> Floats:
    """Last finite value at or before each sample, of values (N, p); ``before`` (p,) until the first finite value."""
    out = np.vstack([before, values])
    last = np.maximum.accumulate(np.where(np.isfinite(out), np.arange(len(out))[:, np.newaxis], 0), axis=0)
    return np.asarray(np.take_along_axis(out, last, axis=0)[1:])
