"""Innovations for bootstrap copies of a record, with its autocorrelation: in matched blocks, or by a sieve.

The autocorrelation ("colour") of the innovations causes a bias of the estimates.  This would be lost if any block could
follow any other.  So the next block is one whose past predicts the same as the end of the block before (matched blocks:
Carlstein et al. 1998).  But with blocks, a burst of noise in the record would recur unchanged in the copies; the sieve
bootstrap has no blocks.
"""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter, lfiltic

from monitor_core.arrays import Floats, Ints

SIMILAR_SHARE, MIN_SIMILAR_BLOCKS = 0.03, 4
"""The next block is drawn from this share of all blocks on each side of the best match, or from this number."""
MAX_PAST_SAMPLES = 500
"""Largest number of past samples that the prediction uses."""
_RIDGE = 1e-6


class MatchedBlocks:
    """Endless innovations for copies, in blocks of ``length`` samples from the record's innovations eps (N,), N > 1.

    Each copy has its own ``many`` blocks, drawn with replacement, and uses them repeatedly.
    """

    def __init__(self, eps: Floats, length: int, many: int, copies: int, rng: np.random.Generator) -> None:
        self._eps, self._length, self._rng = eps, min(length, len(eps) - 1), rng
        self._near = min(max(MIN_SIMILAR_BLOCKS, round(SIMILAR_SHARE * many)), many)
        predicted = predicted_sum(eps, min(max(1, self._length // 2), MAX_PAST_SAMPLES))
        first = rng.integers(1, len(eps) - self._length + 1, (copies, many))
        order = np.argsort(predicted[first - 1], axis=1)
        # (copies, blocks), sorted by the prediction before
        self._first = np.take_along_axis(first, order, axis=1)
        before, at_end = predicted[self._first - 1], predicted[self._first + self._length - 1]
        self._next = np.array([np.searchsorted(*source) for source in zip(before, at_end, strict=True)])
        self._at = rng.integers(0, first.shape[1], copies)
        self._left = np.zeros((0, copies))

    @property
    def samples(self) -> int:
        """Number of samples of a copy, repeated ones included."""
        return self._length * int(self._first.shape[1])

    def take(self, count: int) -> Floats:
        """The next innovations (count, copies)."""
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


# --- Sieve bootstrap: any length, without blocks, with the spectrum and the shocks of a record ------------------------


# The autocorrelation is removed by an autoregression.  The remaining shocks are drawn in pieces too short to contain a
# burst.  Then the autocorrelation is restored (Buehlmann 1997).

_ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_MIN_SAMPLES_EACH = 20
"""Least number of samples of the record for each coefficient."""
_PIECE_SAMPLES = 10
"""Samples that are drawn in one piece, which keeps their dependence beyond the autocorrelation."""
_SETTLING_SAMPLES = 1000


class SieveBootstrap:
    """Endless innovations for copies, from the record's innovations eps (N,), N > 1, of mean zero."""

    def __init__(self, eps: Floats, copies: int, rng: np.random.Generator) -> None:
        self._copies, self._rng = copies, rng
        self._a = whitening_filter(eps)
        residuals = lfilter(self._a, [1.0], eps)[len(self._a) - 1 :]
        self._shocks = Shocks(residuals - residuals.mean())
        start = lfiltic([1.0], self._a, np.zeros(len(self._a) - 1))
        self._state = np.repeat(start[:, np.newaxis], copies, axis=1)
        self._left, self._left_of = np.zeros((0, copies)), np.zeros((0, copies), np.int64)
        self.origin = self._left_of
        """Sample of the record that each innovation of the last ``take`` was drawn from (count, copies)"""
        self.take(_SETTLING_SAMPLES)

    def take(self, count: int) -> Floats:
        """The next innovations (count, copies)."""
        piece = min(_PIECE_SAMPLES, len(self._shocks))
        while len(self._left) < count:
            many = (count - len(self._left)) // piece + 1
            first = self._rng.integers(0, len(self._shocks) - piece + 1, (many, 1, self._copies))
            index = (first + np.arange(piece)[:, np.newaxis]).reshape(many * piece, self._copies)
            self._left = np.concatenate([self._left, self._shocks.drawn(index, self._rng)])
            self._left_of = np.concatenate([self._left_of, index + len(self._a) - 1])
        out, self._left = self._left[:count], self._left[count:]
        self.origin, self._left_of = self._left_of[:count], self._left_of[count:]
        out, self._state = lfilter([1.0], self._a, out, axis=0, zi=self._state)
        return np.asarray(out)


def whitening_filter(eps: Floats) -> Floats:
    """Coefficients (1 + order,) of the whitening filter of eps (N,) (Yule and Walker).

    The order is twice that of the smallest AIC.  Coloured innovations have no finite order.  The AIC order predicts
    them best (Shibata 1980), but its spectrum has a bias at peaks and dips, which the intervals do not cover; at twice
    the order the error is random.
    """
    N = len(eps)
    longest = min(2 * _ORDERS[-1], N // _MIN_SAMPLES_EACH)
    r = np.array([eps[: N - lag] @ eps[lag:] for lag in range(longest + 1)]) / N
    best, least = 0, N * np.log(r[0])
    for order in (p for p in _ORDERS if p <= longest):
        a = solve_toeplitz(r[:order], r[1 : order + 1])
        aic = N * np.log(r[0] - a @ r[1 : order + 1]) + 2 * order
        if aic < least:
            best, least = order, aic
    best = min(2 * best, longest)
    return np.append(1.0, -solve_toeplitz(r[:best], r[1 : best + 1])) if best else np.ones(1)


# --- Shocks of a record, with random sizes of the largest -------------------------------------------------------------


# A record has few large shocks, whose sizes are random.  Exceedances of a high level have a generalised Pareto
# distribution (Pickands 1975), which all of them together determine better than each alone.  So a large shock gets
# another size each time it is drawn, from the part of the distribution that belongs to its rank (after McNeil and Frey
# 2000, who draw the tails of residuals in this way).

_LARGE_SHARE = 0.02
"""Share of the shocks on each side that count as large."""
_MIN_LARGE_SHOCKS = 500
"""With fewer large shocks the error of their shape exceeds 0.05; then no shock is changed."""
_MAX_SHAPE = 0.45
"""Largest shape: from 0.5 on the exceedances have no finite variance, and their moments do not determine the shape."""
_NO_SHAPE = 1e-6


class Shocks:
    """Shocks of a record (N,) with resampled tails."""

    def __init__(self, shocks: Floats) -> None:
        self._shocks = shocks
        self._many = many if (many := int(_LARGE_SHARE * len(shocks))) >= _MIN_LARGE_SHOCKS else 0
        self._rank = np.zeros(len(shocks), np.int64)
        """Rank of large shocks: 1, 2 .. from the largest, -1, -2 .. from the lowest; 0 for all others"""
        self._tails = [self._tail(sign) for sign in (1, -1)] if self._many else []

    def __len__(self) -> int:
        return len(self._shocks)

    def _tail(self, sign: int) -> tuple[int, float, float, float]:
        """Tail of the largest (sign 1) or lowest (-1) shocks: sign, level, and scale and shape of the exceedances."""
        falling = np.argsort(-sign * self._shocks)
        self._rank[falling[: self._many]] = sign * np.arange(1, self._many + 1)
        level = float(sign * self._shocks[falling[self._many]])
        sigma, xi = pareto(sign * self._shocks[falling[: self._many]] - level)
        return sign, level, sigma, xi

    def drawn(self, which: Ints, rng: np.random.Generator) -> Floats:
        """Shocks at the indices ``which`` (an array of any shape), the large ones with random sizes."""
        out = self._shocks[which]
        for sign, level, sigma, xi in self._tails:
            rank = sign * self._rank[which]
            large = rank > 0
            probability = (rank[large] - rng.random(np.count_nonzero(large))) / self._many
            out[large] = sign * (level + sigma * np.expm1(-xi * np.log(probability)) / xi)
        return out


def pareto(falling: Floats) -> tuple[float, float]:
    """Scale sigma and shape xi, not 0, of a generalised Pareto distribution of exceedances (N,), falling.

    x is exceeded with probability (1 + xi x / sigma)^(-1 / xi).  By probability-weighted moments (Hosking and Wallis
    1987):  xi = 2 - m / (m - 2 a),  with m the mean of x and a that of x (1 - F).
    """
    N = len(falling)
    m, a = falling.mean(), falling @ (np.arange(N) + 0.5) / N**2
    xi = min(2 - m / max(m - 2 * a, 1e-12 * m), _MAX_SHAPE) if m > 0 else 0.0
    xi = float(xi if abs(xi) > _NO_SHAPE else _NO_SHAPE)
    return float(m * (1 - xi)), xi
