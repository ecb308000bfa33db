"""Blocks of samples: forward fill of slow signals, and the physical limits of what a motor can have measured."""

from collections.abc import Mapping

import numpy as np

from monitor_core.arrays import Floats

PHYSICAL_LIMITS: Mapping[str, float] = {"torque": 1e6, "speed": 1e5, "angle": 1e8}
"""N m, rad/s and rad: more comes from a broken frame or file.  A million newton metres is a ship's propeller;
1e5 rad/s is a million revolutions per minute, and 1e8 rad a day of them."""


def forward_fill(values: Floats, before: Floats) -> Floats:
    """The last finite one of values (N, p) at each sample; until there is one, ``before`` (p,)."""
    out = np.vstack([before, values])
    at = np.maximum.accumulate(np.where(np.isfinite(out), np.arange(len(out))[:, np.newaxis], 0), axis=0)
    return np.asarray(np.take_along_axis(out, at, axis=0)[1:])
