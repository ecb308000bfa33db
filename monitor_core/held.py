"""What is known of slow signals at each sample: the last value that was told."""

import numpy as np

from monitor_core.kernel.tables import Floats


def held(values: Floats, before: Floats) -> Floats:
    """The last finite one of values (N, p) at each sample; until there is one, ``before`` (p,)."""
    out = np.vstack([before, values])
    at = np.maximum.accumulate(np.where(np.isfinite(out), np.arange(len(out))[:, np.newaxis], 0), axis=0)
    return np.asarray(np.take_along_axis(out, at, axis=0)[1:])
