"""Innovations of a record in another order: in blocks that match where they meet, which keeps their colour.

The colour of the innovations causes a bias of the estimates, which would be lost if any block could follow any other.
So the next block is chosen whose past predicts the same as the end of the block before (matched blocks: Carlstein et
al. 1998).  But a burst of noise within a block occurs in copies only as it occurred in the record, again and again.
"""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz

from monitor_core.arrays import Floats

ALIKE, LEAST_ALIKE = 0.03, 4
"""The next block is drawn from this share of all blocks on each side of the best match, or from this number."""
LONGEST = 500
"""Largest number of past samples that the prediction uses."""
_RIDGE = 1e-6


class MatchedBlocks:
    """Endless innovations of copies, from those of the record, eps (N,), at least two, in blocks of ``length`` samples.

    Each copy has its own blocks, ``many``, drawn with replacement, and uses them again and again.
    """

    def __init__(self, eps: Floats, length: int, many: int, copies: int, rng: np.random.Generator) -> None:
        self._eps, self._length, self._rng = eps, min(length, len(eps) - 1), rng
        self._near = min(max(LEAST_ALIKE, round(ALIKE * many)), many)
        promised = predicted_sum(eps, min(max(1, self._length // 2), LONGEST))
        first = rng.integers(1, len(eps) - self._length + 1, (copies, many))
        order = np.argsort(promised[first - 1], axis=1)
        self._first = np.take_along_axis(first, order, axis=1)  # (copies, blocks), by what came before
        before, at_end = promised[self._first - 1], promised[self._first + self._length - 1]
        self._next = np.array([np.searchsorted(*source) for source in zip(before, at_end, strict=True)])
        self._at = rng.integers(0, first.shape[1], copies)
        self._left = np.zeros((0, copies))

    @property
    def samples(self) -> int:
        """Number of samples of a copy, repeated ones included."""
        return self._length * int(self._first.shape[1])

    def take(self, count: int) -> Floats:
        """The next (count, copies)."""
        copies, blocks = np.arange(len(self._at)), self._first.shape[1]
        while len(self._left) < count:
            rows = self._first[copies, self._at] + np.arange(self._length)[:, np.newaxis]
            self._left = np.concatenate([self._left, self._eps[rows]])
            after = self._next[copies, self._at] + self._rng.integers(-self._near, self._near, len(copies))
            after = np.where(after < 0, -1 - after, after)  # reflected at the ends
            self._at = np.where(after < blocks, after, 2 * blocks - 1 - after)
        out, self._left = self._left[:count], self._left[count:]
        return out


def predicted_sum(eps: Floats, lags: int) -> Floats:
    """Best linear prediction (N,), at each sample, of the sum of the next ``lags`` from as many past ones (Wiener)."""
    N, size = len(eps), next_fast_len(len(eps) + 2 * lags + 1, real=True)
    F = rfft(eps, size)
    r = irfft(np.abs(F) ** 2, size)[: 2 * lags + 1]  # autocovariance, by N
    sums = np.cumsum(np.append(0.0, r))
    past = np.arange(1, lags + 1)
    r[0] *= 1 + _RIDGE
    weights = solve_toeplitz(r[:lags], sums[past + lags] - sums[past])
    return np.asarray(irfft(F * rfft(weights, size), size)[:N])
