"""The scatter of healthy records, shrunk towards that of their bootstrap copies.

The copies determine the scatter much better than a record, which is short, and they contain the bias of the recursion
under coloured innovations, as the recursion itself runs over them; but they contain no model errors.  So the difference
between a record and its copies is treated as chance as far as chance explains it, and otherwise as real.  The copies
themselves have an error from the innovations that they are made of (``own_error``).

The prior of the differences is the horseshoe (Carvalho, Polson and Scott 2010): numbers N(0, tau^2 zeta_i^2) with half
Cauchy zeta_i.  All share one tau: where all are far from zero, none is shrunk; where none is, all are.  The prior of
tau is half Cauchy with the scale tau_0 for the expected number of nonzero ones among n (Piironen and Vehtari 2017).
"""

from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.copy_excursions import Excursions
from monitor_core.calibration.scatter import Scatter

MOST_OWN = 0.5
"""Largest share of the error of the copies in the chance of a record."""
EXPECTED = 0.25
"""Prior number of nonzero differences: one in four axes.  A large difference is not shrunk in any case."""
_STEPS, _SCALES, _WIDE = 120, 60, 9.0
"""Points of zeta and of tau in equal steps of their logarithms, and the largest logarithm."""
_FARTHEST = 1e3
"""In standard deviations: beyond it nothing is shrunk, and the weights would underflow."""
_TINY = 1e-300


def shrink(scatter: Scatter, found: Excursions, rng: np.random.Generator) -> Scatter:
    """Scatter of the records, shrunk towards the mean and size that the bootstrap copies give."""
    p, times = len(scatter.sigma), len(scatter.power)
    own = rng.multivariate_normal(np.zeros(2 * p), found.error, size=times)
    differs = [(scatter.mean_d - found.mean) / found.sigma, np.log(scatter.sigma / found.sigma)]
    chance = [scatter.off / found.sigma, np.log(scatter.power) / 2]
    centre, apart = _shrinkage(np.concatenate(differs), np.hstack(chance), own, rng)
    return replace(
        scatter,
        mean_d=found.mean + found.sigma * centre[:p],
        off=found.sigma * apart[:, :p],
        sigma=found.sigma * np.exp(centre[p:]),
        power=np.exp(2 * apart[:, p:]),
    )


def _shrinkage(
    differs: Floats, chance: Floats, own: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """What to add to the numbers of the copies (n,), and draws of the remaining error (B, n).

    ``differs`` (n,): numbers of the record less those of the copies; ``chance`` of the record, and ``own`` error of the
    copies (B, n).  The chance of a record contains the error of the copies, as both come from the same innovations.  So
    that error is not part of their difference, and stays.
    """
    sd, sd_own = chance.std(axis=0), own.std(axis=0)
    most = np.minimum(sd_own, MOST_OWN * sd)
    rest = np.sqrt(sd**2 - most**2)
    lacks = rest * draw_posterior(differs / rest, chance / sd, rng)
    centre = lacks.mean(axis=0)
    return centre, lacks - centre + own * most / np.maximum(sd_own, _TINY)


def draw_posterior(e: Floats, chance: Floats, rng: np.random.Generator) -> Floats:
    """Draws of the true numbers (B, n) from the posterior.

    ``e`` (n,), n > 1, are observed, in standard deviations of their chance.  ``chance`` (B, n) is standard normal, for
    what is unknown given kappa; shared by numbers observed with the same chance.
    """
    B, n = chance.shape
    tau, of_tau = _half_cauchy(_SCALES)
    zeta, of_zeta = _half_cauchy(_STEPS)
    kappa = 1 / (1 + np.outer(tau * EXPECTED / (n - EXPECTED), zeta) ** 2)
    weights = of_zeta[:, np.newaxis] * _likelihood(e, kappa)
    log = np.log(of_tau) + np.log(weights.sum(axis=1)).sum(axis=-1)
    likely = np.exp(log - log.max())
    which = rng.choice(len(kappa), size=(B, 1), p=likely / likely.sum())
    share = np.hstack([_draw_kappa(kappa, weights[:, :, i], which[:, 0], rng) for i in range(n)])
    return np.asarray(e - share * _shrink_factor(e) + np.sqrt(1 - share) * chance)


def _draw_kappa(kappa: Floats, weights: Floats, which: Ints, rng: np.random.Generator) -> Floats:
    """One kappa for each row (B, 1), drawn by its probability within the row."""
    up_to = np.cumsum(weights, axis=1)
    up_to /= up_to[:, -1:]
    all_rows = (up_to + np.arange(len(kappa))[:, np.newaxis]).ravel()  # rising, all the way
    return np.asarray(kappa.ravel()[np.searchsorted(all_rows, which + rng.random(len(which)))])[:, np.newaxis]


def _likelihood(e: Floats, kappa: Floats) -> Floats:
    """Likelihood of kappa = 1 / (1 + tau^2 zeta^2) (T, S), for each number (T, S, n).

    Given kappa the observation is N(0, 1 / kappa), and the number has the mean (1 - kappa) e and the variance 1 -
    kappa.
    """
    log = np.log(kappa)[:, :, np.newaxis] / 2 - kappa[:, :, np.newaxis] * _shrink_factor(e) ** 2 / 2
    return np.asarray(np.maximum(np.exp(log - log.max(axis=(0, 1))), _TINY))


def _half_cauchy(n: int) -> tuple[Floats, Floats]:
    """Quadrature points and weights (n,) of the half Cauchy distribution."""
    x = np.exp(np.linspace(-_WIDE, _WIDE, n))
    weight = 1 / (x + 1 / x)
    return x, weight / weight.sum()


def _shrink_factor(e: Floats) -> Floats:
    return np.asarray(np.clip(e, -_FARTHEST, _FARTHEST))
