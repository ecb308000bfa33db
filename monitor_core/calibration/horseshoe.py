"""What several numbers may truly be of which each was seen with chance, where most of them are nothing.

The horseshoe (Carvalho, Polson and Scott 2010): numbers N(0, tau^2 zeta_i^2) with half Cauchy zeta_i.  One tau is for
all of them: where all are far out, none is taken for chance; where none is, all are.  Before, it is half Cauchy about
the tau_0 with which one of n numbers is expected to be something (Piironen and Vehtari 2017).
"""

import math

import numpy as np

from monitor_core.kernel.tables import Floats

_STEPS, _SCALES = 400, 60
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
    kappa, weights = _posterior(e)
    log = np.log(weights.mean(axis=1)).sum(axis=-1)
    of_tau = np.exp(log - log.max())
    which = rng.choice(len(kappa), size=(B, 1), p=of_tau / of_tau.sum())
    of_kappa = np.cumsum(weights, axis=1)
    of_kappa /= of_kappa[:, -1:]
    at = np.sum(of_kappa[which[:, 0]] < rng.random((B, 1, n)), axis=1)
    of = kappa[which, at]
    return np.asarray(e - of * _near(e) + np.sqrt(1 - of) * chance)


def _posterior(e: Floats) -> tuple[Floats, Floats]:
    """kappa = 1 / (1 + tau^2 zeta^2) by tau and zeta (T, S), and how likely they are for each number (T, S, n).

    Equal steps of the prior in both.  Given kappa a number has the mean (1 - kappa) e and the variance 1 - kappa.
    """
    tau = _half_cauchy(_SCALES) / (len(e) - 1)
    kappa = 1 / (1 + np.outer(tau, _half_cauchy(_STEPS)) ** 2)
    log = np.log(kappa)[:, :, np.newaxis] / 2 - kappa[:, :, np.newaxis] * _near(e) ** 2 / 2
    return kappa, np.maximum(np.exp(log - log.max(axis=(0, 1))), _TINY)


def _half_cauchy(n: int) -> Floats:
    """Quantiles in the middles of n equal steps."""
    return np.asarray(np.tan(math.pi / 2 * (np.arange(n) + 0.5) / n))


def _near(e: Floats) -> Floats:
    return np.asarray(np.clip(e, -_FARTHEST, _FARTHEST))
