"""Error of bootstrap copies of healthy records, because the records are short.

Copies that each have only a few of the innovations, blocks drawn with replacement, differ from each other by the chance
of these blocks.  All the innovations of the records are chance, too, but less so the more there are (bootstrap of a
bootstrap: Hall 1992; m out of n: Bickel, Goetze and van Zwet 1997).
"""

import math
from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats

PartSums = tuple[Floats, float]
"""Of a part of the records: sums of the deviations and of their squares (2, p, W), and number of samples."""


def part_sums(d: Floats) -> PartSums:
    """Sums of the deviations d (n, p, W) of a part of the records."""
    return np.stack([d.sum(axis=0), (d * d).sum(axis=0)]), float(len(d))


def own_error(parts: Sequence[PartSums]) -> Floats:
    """Covariance (2 p, 2 p) between copies due to their blocks: of the means, over sigma, and of log sigma.

    More colour makes more bias and more scatter of all parameters that it reaches, so these errors are correlated.
    """
    sums, n = np.array([s for s, _ in parts]), np.array([n for _, n in parts])[:, np.newaxis, np.newaxis]
    of_copy, square = sums.sum(axis=0) / n.sum()
    variance = (square - of_copy**2).mean(axis=-1, keepdims=True)
    record, two = sums[:, 0] / n, sums[:, 1] / n
    louder = (two - 2 * of_copy * record + of_copy**2) / variance
    # Contributions of each part to both, of each copy (R, 2 p, W); their means are those of the copy.
    x = np.concatenate([record / np.sqrt(variance), louder / 2], axis=1)
    R, W = len(x), x.shape[-1]
    means, copies = x.mean(axis=-1, keepdims=True), x.mean(axis=0)
    # Analysis of variance: differences of a copy between parts are chance.
    rest = x - means - copies + means.mean(axis=0)
    chance = np.einsum("riw,rjw->ij", rest, rest) / ((R - 1) * (W - 1)) / R
    return excess_covariance(np.cov(copies), chance, W)


def excess_covariance(seen: Floats, chance: Floats, times: int) -> Floats:
    """The significant part of a covariance (n, n) beyond that of chance (n, n).

    A spiked covariance (Donoho, Gavish and Johnstone 2018): of the eigenvalues, in units of chance, those above what
    chance alone would give with ``times`` draws, less its contribution to them.
    """
    root = np.linalg.cholesky(chance)
    half = np.linalg.solve(root, seen)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    gamma = len(values) / times
    sum_ = np.maximum(values + 1 - gamma, 2 * np.sqrt(np.maximum(values, 0.0)))
    spikes = (sum_ + np.sqrt(np.maximum(sum_**2 - 4 * values, 0.0))) / 2
    stands_out = values > (1 + math.sqrt(gamma)) ** 2
    V = root @ vectors
    return np.asarray((V * np.where(stands_out, spikes - 1, 0.0)) @ V.T)
