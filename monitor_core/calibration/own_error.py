"""What copies of healthy records are off by, because the records are short.

Copies of which each has only few of the innovations, blocks drawn with replacement, differ all along: by what they have
from these blocks by chance.  All the innovations of the records are chance, too, the less the more they are (bootstrap
of a bootstrap: Hall 1992; m out of n: Bickel, Goetze and van Zwet 1997).
"""

import math

import numpy as np

from monitor_core.kernel.tables import Floats


def own_error(sums: Floats, counts: Floats) -> Floats:
    """Covariance (2 p, 2 p) of what copies have from their blocks: of the means, over sigma, and of the log sigma.

    An analysis of variance: what copies differ by in all parts of the record, beyond what they differ by from part to
    part, and beyond a standard error of that.  More colour makes more bias and more scatter, of all parameters that it
    reaches: these errors go together, as the differences of copies do.

    Args:
        sums: of the deviations and of their squares (R, 2, p, W), in R > 1 parts of the records and W copies.
        counts: samples (R,) that were added up in each part, of one copy.
    """
    mean, square = np.einsum("rkpw->kp", sums) / (counts.sum() * sums.shape[3])
    variance = square - mean**2
    one, two = np.moveaxis(sums / counts[:, np.newaxis, np.newaxis, np.newaxis], 1, 0)  # (R, p, W) each
    m, v = mean[:, np.newaxis], variance[:, np.newaxis]
    x = np.concatenate([(one - m) / np.sqrt(v), (two - 2 * m * one + m**2) / (2 * v)], axis=1)  # (R, 2 p, W)
    R, W = len(x), x.shape[-1]
    parts, copies = x.mean(axis=-1, keepdims=True), x.mean(axis=0)
    rest = x - parts - copies + parts.mean(axis=0)
    chance = (rest**2).sum(axis=(0, -1)) / ((R - 1) * (W - 1)) / R
    among = np.cov(copies)
    share = np.sqrt(np.maximum(1 - chance / np.diag(among) * (1 + math.sqrt(2 / (W - 1))), 0.0))
    return np.asarray(share[:, np.newaxis] * among * share)
