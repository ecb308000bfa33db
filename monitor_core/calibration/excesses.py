"""Shocks drawn from a record's, and the largest as they might as well have been.

A record has few large shocks, and what they make of its copies hangs on how large these few happened to be.  What
exceeds a high level is of a generalised Pareto distribution (Pickands 1975), of which all that exceed it tell more than
each tells of itself: so each has another size each time it is drawn, of those that go with its rank (after McNeil and
Frey 2000, who draw the tails of residuals likewise).
"""

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

_SHARE = 0.02
"""Of the shocks, on each side, that are large."""
_FEWEST = 500
"""With fewer large ones, which tell their shape no better than within 0.05, all stay as they are."""
_MOST_SHAPE = 0.45
"""From 0.5 on what exceeds the level has no variance, and its moments do not tell the shape."""
_NO_SHAPE = 1e-6


class Shocks:
    """Of a record (N,)."""

    def __init__(self, shocks: Floats) -> None:
        self._shocks = shocks
        self._many = many if (many := int(_SHARE * len(shocks))) >= _FEWEST else 0
        self._rank = np.zeros(len(shocks), np.int64)
        """Of the large ones: 1 the largest, -1 the lowest"""
        self._tails = [self._tail(sign) for sign in (1, -1)] if self._many else []

    def __len__(self) -> int:
        return len(self._shocks)

    def _tail(self, sign: int) -> tuple[int, float, float, float]:
        """Of the largest, or the lowest: the sign, the level, and scale and shape of what exceeds it."""
        falling = np.argsort(-sign * self._shocks)
        self._rank[falling[: self._many]] = sign * np.arange(1, self._many + 1)
        level = float(sign * self._shocks[falling[self._many]])
        sigma, xi = pareto(sign * self._shocks[falling[: self._many]] - level)
        return sign, level, sigma, xi

    def drawn(self, which: NDArray[np.int64], rng: np.random.Generator) -> Floats:
        """Those with the indices ``which``, of any shape."""
        out = self._shocks[which]
        for sign, level, sigma, xi in self._tails:
            rank = sign * self._rank[which]
            large = rank > 0
            probability = (rank[large] - rng.random(np.count_nonzero(large))) / self._many
            out[large] = sign * (level + sigma * np.expm1(-xi * np.log(probability)) / xi)
        return out


def pareto(falling: Floats) -> tuple[float, float]:
    """Scale sigma and shape xi, not 0, of a generalised Pareto distribution, of excesses (N,) of it as they fall.

    x is exceeded with probability (1 + xi x / sigma)^(-1 / xi).  By probability-weighted moments (Hosking and Wallis
    1987):  xi = 2 - m / (m - 2 a),  with m the mean of x and a that of x (1 - F).
    """
    N = len(falling)
    m, a = falling.mean(), falling @ (np.arange(N) + 0.5) / N**2
    xi = min(2 - m / max(m - 2 * a, 1e-12 * m), _MOST_SHAPE) if m > 0 else 0.0
    xi = float(xi if abs(xi) > _NO_SHAPE else _NO_SHAPE)
    return float(m * (1 - xi)), xi
