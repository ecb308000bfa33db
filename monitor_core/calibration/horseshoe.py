"""What several numbers may truly be of which each was seen with chance, where most of them are nothing.

The horseshoe (Carvalho, Polson and Scott 2010): numbers N(0, tau^2 zeta_i^2) with half Cauchy zeta_i.  One tau is for
all of them: where all are far out, none is taken for chance; where none is, all are.  Before, it is half Cauchy about
the tau_0 that goes with how many of n numbers are expected to be something (Piironen and Vehtari 2017).
"""

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

EXPECTED = 0.25
"""Numbers that are something, beforehand: one, of four axes.  What is far out is believed all the same."""
_STEPS, _SCALES, _WIDE = 120, 60, 9.0
"""Points of zeta and of tau, equal steps of their logarithms, to so far from what is in the middle."""
_FARTHEST = 1e3
"""Standard deviations: what is farther out is not shrunk at all, and its weights would underflow."""
_TINY = 1e-300


def drawn(e: Floats, chance: Floats, rng: np.random.Generator) -> Floats:
    """What the numbers may be (B, n), drawn from the posterior.

    Args:
        e: the numbers as seen (n,), n > 1, in standard deviations of their chance.
        chance: standard normal (B, n), of what is not known given kappa; numbers seen with the same chance share it.
        rng: of tau and kappa.
    """
    B, n = chance.shape
    tau, of_tau = _half_cauchy(_SCALES)
    zeta, of_zeta = _half_cauchy(_STEPS)
    kappa = 1 / (1 + np.outer(tau * EXPECTED / (n - EXPECTED), zeta) ** 2)
    weights = of_zeta[:, np.newaxis] * _likelihood(e, kappa)
    log = np.log(of_tau) + np.log(weights.sum(axis=1)).sum(axis=-1)
    likely = np.exp(log - log.max())
    which = rng.choice(len(kappa), size=(B, 1), p=likely / likely.sum())
    of = np.hstack([_chosen(kappa, weights[:, :, i], which[:, 0], rng) for i in range(n)])
    return np.asarray(e - of * _near(e) + np.sqrt(1 - of) * chance)


def _chosen(kappa: Floats, weights: Floats, which: NDArray[np.int64], rng: np.random.Generator) -> Floats:
    """One kappa for each of these rows (B, 1), as likely as it is within its row."""
    up_to = np.cumsum(weights, axis=1)
    up_to /= up_to[:, -1:]
    all_rows = (up_to + np.arange(len(kappa))[:, np.newaxis]).ravel()  # rising, all the way
    return np.asarray(kappa.ravel()[np.searchsorted(all_rows, which + rng.random(len(which)))])[:, np.newaxis]


def _likelihood(e: Floats, kappa: Floats) -> Floats:
    """Of kappa = 1 / (1 + tau^2 zeta^2) (T, S), for each number (T, S, n).

    Given kappa what is seen is N(0, 1 / kappa), and the number has the mean (1 - kappa) e and the variance 1 - kappa.
    """
    log = np.log(kappa)[:, :, np.newaxis] / 2 - kappa[:, :, np.newaxis] * _near(e) ** 2 / 2
    return np.asarray(np.maximum(np.exp(log - log.max(axis=(0, 1))), _TINY))


def _half_cauchy(n: int) -> tuple[Floats, Floats]:
    """Points and their weights (n,)."""
    x = np.exp(np.linspace(-_WIDE, _WIDE, n))
    weight = 1 / (x + 1 / x)
    return x, weight / weight.sum()


def _near(e: Floats) -> Floats:
    return np.asarray(np.clip(e, -_FARTHEST, _FARTHEST))
