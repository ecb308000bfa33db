"""What copies of healthy records are off by, because the records are short.

Copies of which each has only few of the innovations, blocks drawn with replacement, differ all along: by what they have
from these blocks by chance.  All the innovations of the records are chance, too, the less the more they are (bootstrap
of a bootstrap: Hall 1992; m out of n: Bickel, Goetze and van Zwet 1997).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from monitor_core.arrays import Floats


@dataclass
class Parts:
    """Sums over parts of the records, of each of W copies and p parameters."""

    _sums: list[Floats] = field(default_factory=list)
    _counts: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._sums)

    def add(self, d: Floats) -> None:
        """Deviations (n, p, W) of a part."""
        self._sums.append(np.stack([d.sum(axis=0), (d * d).sum(axis=0)]))
        self._counts.append(float(len(d)))

    def own_error(self) -> Floats:
        """Covariance (2 p, 2 p) of what copies have from their blocks: of the means, over sigma, and of log sigma.

        More colour makes more bias and more scatter, of all parameters that it reaches: these errors go together.
        """
        x = self._each()
        R, W = len(x), x.shape[-1]
        parts, copies = x.mean(axis=-1, keepdims=True), x.mean(axis=0)
        # An analysis of variance: what copies differ by from part to part is chance.
        rest = x - parts - copies + parts.mean(axis=0)
        chance = np.einsum("riw,rjw->ij", rest, rest) / ((R - 1) * (W - 1)) / R
        return beyond(np.cov(copies), chance, W)

    def _each(self) -> Floats:
        """What each part makes of both, of each copy (R, 2 p, W); means of these are what the copy has."""
        sums, n = np.array(self._sums), np.array(self._counts)[:, np.newaxis, np.newaxis]
        of_copy, square = sums.sum(axis=0) / n.sum()
        variance = (square - of_copy**2).mean(axis=-1, keepdims=True)
        one, two = sums[:, 0] / n, sums[:, 1] / n
        louder = (two - 2 * of_copy * one + of_copy**2) / variance
        return np.concatenate([one / np.sqrt(variance), louder / 2], axis=1)


def beyond(seen: Floats, chance: Floats, times: int) -> Floats:
    """What a covariance (n, n), seen ``times`` times, has beyond that of chance (n, n), as far as it stands out.

    A spiked covariance (Donoho, Gavish and Johnstone 2018): of eigenvalues, in units of chance, those above what chance
    alone would make, without what it added to them.
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
