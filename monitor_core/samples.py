"""Block of samples of one axis, forward fill of slow signals, and physical limits of measured values."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

PHYSICAL_LIMITS: Mapping[str, float] = {"torque": 1e6, "speed": 1e5, "angle": 1e8}
"""N m, rad/s and rad: more comes from a broken frame or file.  A million newton metres is a ship's propeller;
1e5 rad/s is a million revolutions per minute, and 1e8 rad a day of them."""


class SampleBlock(NamedTuple):
    """Samples of one axis, in the order of their receipt."""

    t_us: NDArray[np.int64]  # (N,) time [us]
    torque: Floats  # (N,) motor torque [N m]
    motion: Floats  # (N,) motor speed [rad/s], or motor angle [rad]
    shift: Floats | None = None
    """(N, p) theta_0(s) - theta_0, where nominal values follow conditions; NaN: conditions unknown; None: as before"""
    gate: NDArray[np.bool_] | None = None
    """(N,) nothing is learned where it is False; None: all samples are used"""
    signals: Floats | None = None
    """(N, S) auxiliary signals, from which shift and gate are computed; NaN: unknown; None: the axis needs none"""


def forward_fill(values: Floats, before: Floats) -> Floats:
    """The last finite one of values (N, p) at each sample; until there is one, ``before`` (p,)."""
    out = np.vstack([before, values])
    at = np.maximum.accumulate(np.where(np.isfinite(out), np.arange(len(out))[:, np.newaxis], 0), axis=0)
    return np.asarray(np.take_along_axis(out, at, axis=0)[1:])
