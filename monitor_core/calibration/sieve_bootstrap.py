"""Synthetic innovations of any length, with the spectrum and the shocks of those of a record.

The colour is removed by an autoregression, the shocks that are left are drawn in pieces too short to hold a burst, and
the colour is restored (Buehlmann 1997).
"""

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter, lfiltic

from monitor_core.arrays import Floats, Ints

_ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_SAMPLES_EACH = 20
"""Least number of samples of the record for each coefficient."""
_TOGETHER = 10
"""Samples that are drawn in one piece, which keeps what they have in common beside their colour."""
_SETTLING = 1000


class SieveBootstrap:
    """Endless innovations of copies, from those of the record, eps (N,), at least two, of mean zero."""

    def __init__(self, eps: Floats, copies: int, rng: np.random.Generator) -> None:
        self._copies, self._rng = copies, rng
        self._a = whitening_filter(eps)
        residuals = lfilter(self._a, [1.0], eps)[len(self._a) - 1 :]
        self._shocks = Shocks(residuals - residuals.mean())
        start = lfiltic([1.0], self._a, np.zeros(len(self._a) - 1))
        self._state = np.repeat(start[:, np.newaxis], copies, axis=1)
        self._left, self._left_of = np.zeros((0, copies)), np.zeros((0, copies), np.int64)
        self.origin = self._left_of
        """Of what was taken last (count, copies): which sample of the record each is drawn from"""
        self.take(_SETTLING)

    def take(self, count: int) -> Floats:
        """The next (count, copies)."""
        piece = min(_TOGETHER, len(self._shocks))
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

    The order is twice that of the smallest AIC: coloured innovations have no finite order.  The AIC order predicts them
    best (Shibata 1980), but has a bias where their power is large or small, which no interval covers; at twice the
    order the error is chance.
    """
    N = len(eps)
    longest = min(2 * _ORDERS[-1], N // _SAMPLES_EACH)
    r = np.array([eps[: N - lag] @ eps[lag:] for lag in range(longest + 1)]) / N
    best, least = 0, N * np.log(r[0])
    for order in (p for p in _ORDERS if p <= longest):
        a = solve_toeplitz(r[:order], r[1 : order + 1])
        aic = N * np.log(r[0] - a @ r[1 : order + 1]) + 2 * order
        if aic < least:
            best, least = order, aic
    best = min(2 * best, longest)
    return np.append(1.0, -solve_toeplitz(r[:best], r[1 : best + 1])) if best else np.ones(1)


# --- Shocks drawn from a record's, and the largest as they might as well have been ------------------------------------


# A record has few large shocks, and their effect on its copies depends on how large these few happened to be.
# Exceedances of a high level have a generalised Pareto distribution (Pickands 1975), which all of them together
# determine better than each alone: so each gets another size each time it is drawn, among those of its rank (after
# McNeil and Frey 2000, who draw the tails of residuals in this way).

_SHARE = 0.02
"""Share of the shocks on each side that count as large."""
_FEWEST = 500
"""With fewer large shocks their shape is known no better than within 0.05: then all stay as they are."""
_MOST_SHAPE = 0.45
"""From a shape of 0.5 on the exceedances have no variance, and their moments do not determine the shape."""
_NO_SHAPE = 1e-6


class Shocks:
    """Shocks of a record (N,) with resampled tails."""

    def __init__(self, shocks: Floats) -> None:
        self._shocks = shocks
        self._many = many if (many := int(_SHARE * len(shocks))) >= _FEWEST else 0
        self._rank = np.zeros(len(shocks), np.int64)
        """Of the large ones: 1 the largest, -1 the lowest"""
        self._tails = [self._tail(sign) for sign in (1, -1)] if self._many else []

    def __len__(self) -> int:
        return len(self._shocks)

    def _tail(self, sign: int) -> tuple[int, float, float, float]:
        """Of the largest, or the smallest, shocks: the sign, the level, and scale and shape of their exceedances."""
        falling = np.argsort(-sign * self._shocks)
        self._rank[falling[: self._many]] = sign * np.arange(1, self._many + 1)
        level = float(sign * self._shocks[falling[self._many]])
        sigma, xi = pareto(sign * self._shocks[falling[: self._many]] - level)
        return sign, level, sigma, xi

    def drawn(self, which: Ints, rng: np.random.Generator) -> Floats:
        """Shocks at the indices ``which``, of any shape."""
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
    xi = min(2 - m / max(m - 2 * a, 1e-12 * m), _MOST_SHAPE) if m > 0 else 0.0
    xi = float(xi if abs(xi) > _NO_SHAPE else _NO_SHAPE)
    return float(m * (1 - xi)), xi
