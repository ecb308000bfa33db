"""Statistics of healthy records, from which thresholds are computed: scatter, allowance, tails of the CUSUM sums."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.copy_excursions import SAMPLES, Excursions, simulate_excursions
from monitor_core.calibration.false_alarm_tail import Tail, tails
from monitor_core.calibration.healthy_records import RecordDeviations
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.scatter import SAMPLES_PER_MEMORY, Scatter, binned, scatter
from monitor_core.samples import SampleBlock
from monitor_core.settings import ALLOWED


@dataclass(frozen=True)
class HealthyStatistics:
    """Scatter of the estimates, allowance of the tests, and tails of the sums, for p parameters."""

    scatter: Scatter
    alone: Scatter
    """The same scatter with the larger uncertainty that the records alone leave, without the copies"""
    allowance: Floats  # (p,), in sizes
    tails: tuple[Tail, ...]


def healthy_statistics(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    found: Sequence[RecordDeviations],
    k: float,
    rng: np.random.Generator,
    copies: int = SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> HealthyStatistics:
    """Statistics from which thresholds are computed.

    ``found``: deviations of the records.  ``k``: nu over sigma (``nu_over_sigma``).  ``copies``: number of samples of
    bootstrap copies.

    Raises:
        ValueError: in no record a parameter was tested, or estimates were updated.
    """
    excursions = simulate_excursions(axis, records, k, rng, copies, progress)
    seen = scatter(found, axis.settings.memory, rng)
    shrunk = shrink(seen, excursions, rng)
    alone = replace(shrunk, off=seen.off, power=seen.power)
    return HealthyStatistics(shrunk, alone, allowance(found, shrunk), tails(shrunk, excursions))


MIN_PART_MEMORIES, MAX_PARTS = 20, 10
"""Least number of memories in a part of a record, and largest number of parts."""
MIN_CONFIDENCE = 0.99
"""Confidence with which the parts must differ by more than chance."""


def allowance(found: Sequence[RecordDeviations], scatter: Scatter) -> Floats:
    """Allowance of each parameter (p,), in sizes.

    If there is only noise, the means of parts of the records scatter by sigma sqrt(2 / memories).  A larger scatter
    (DerSimonian and Laird 1986; only if chance does not explain it) is a variable bias, by the pose or the temperature.
    The constant bias, by inexact nominal values, is added.
    """
    means, weights = [], []
    for record in found:
        d = binned(record, scatter.memory)[:, 0]
        count = int(np.clip(len(d) // (MIN_PART_MEMORIES * SAMPLES_PER_MEMORY), 1, MAX_PARTS))
        for part in np.array_split(d, count) if len(d) else ():
            means.append(part.mean(axis=0))
            weights.append(len(part) / SAMPLES_PER_MEMORY / 2)
    m, w = np.array(means), np.array(weights)[:, np.newaxis]
    if len(m) < 2:
        return scatter.beyond
    # The scatter within the parts, as the scatter between them is tested.
    inside = np.sqrt(np.maximum(scatter.sigma**2 - m.var(axis=0), 0.1 * scatter.sigma**2))
    w = w / inside**2
    mean = (w * m).sum(axis=0) / w.sum(axis=0)
    Q, freedom = (w * (m - mean) ** 2).sum(axis=0), len(m) - 1
    excess = (Q - freedom) / (w.sum(axis=0) - (w**2).sum(axis=0) / w.sum(axis=0))
    real = 2 * gammaincinv(freedom / 2, MIN_CONFIDENCE ** (1 / len(Q))) < Q
    return np.asarray(scatter.beyond + np.where(real, ALLOWED * np.sqrt(np.maximum(excess, 0.0)), 0.0))


# --- Scatter of the records, shrunk towards that of their copies ------------------------------------------------------


# The copies determine the scatter much better than a short record does.  They contain the bias of the recursion under
# coloured innovations, as the recursion itself runs over them; but they contain no model errors.  So a difference
# between a record and its copies is treated as chance if chance explains it, and otherwise as real.  The copies
# themselves have an error from the innovations that they are made of (``copy_excursions.copy_covariance``).
#
# The prior of the differences is the horseshoe (Carvalho, Polson and Scott 2010): numbers N(0, tau^2 zeta_i^2) with
# half Cauchy zeta_i and a common tau.  If all differences are far from zero, none is shrunk; if none is, all are.  The
# prior of tau is half Cauchy with the scale tau_0 for the expected number of nonzero differences among n (Piironen and
# Vehtari 2017).

MAX_COPY_ERROR = 0.5
"""The error of the copies accounts for at most this share of the standard deviation of a record."""
EXPECTED_DIFFERENCES = 0.25
"""Prior number of nonzero differences: one in four axes.  A large difference is not shrunk in any case."""
_ZETA_POINTS, _TAU_POINTS, _MAX_LOG = 120, 60, 9.0
"""Numbers of points of zeta and of tau, in equal steps of their logarithms, and the largest logarithm."""
_MAX_SIGMAS = 1e3
"""Standard deviations.  A larger difference is not shrunk anyway, and its weights would underflow."""
_TINY = 1e-300


def shrink(scatter: Scatter, found: Excursions, rng: np.random.Generator) -> Scatter:
    """Scatter of the records, with mean and standard deviation shrunk towards those of the bootstrap copies."""
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


def _shrinkage(differs: Floats, chance: Floats, own: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Corrections to the numbers of the copies (n,), and draws of the remaining error (B, n).

    ``differs`` (n,): numbers of the record minus those of the copies.  ``chance`` (B, n): draws of the error of the
    record; ``own`` (B, n): draws of the error of the copies.  Both errors come from the same innovations, so the error
    of the record contains that of the copies, which cancels in their difference and remains in the result.
    """
    sd, sd_own = chance.std(axis=0), own.std(axis=0)
    common = np.minimum(sd_own, MAX_COPY_ERROR * sd)
    rest = np.sqrt(sd**2 - common**2)
    correction = rest * draw_posterior(differs / rest, chance / sd, rng)
    centre = correction.mean(axis=0)
    return centre, correction - centre + own * common / np.maximum(sd_own, _TINY)


def draw_posterior(e: Floats, chance: Floats, rng: np.random.Generator) -> Floats:
    """Draws of the true numbers (B, n) from the posterior.

    ``e`` (n,), n > 1: observed numbers, in standard deviations of their errors.  ``chance`` (B, n): standard normal
    draws for the uncertainty given kappa; correlated if the errors of the numbers are.
    """
    B, n = chance.shape
    tau, of_tau = _half_cauchy(_TAU_POINTS)
    zeta, of_zeta = _half_cauchy(_ZETA_POINTS)
    kappa = 1 / (1 + np.outer(tau * EXPECTED_DIFFERENCES / (n - EXPECTED_DIFFERENCES), zeta) ** 2)
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
    all_rows = (up_to + np.arange(len(kappa))[:, np.newaxis]).ravel()  # ascending: one search serves all rows
    return np.asarray(kappa.ravel()[np.searchsorted(all_rows, which + rng.random(len(which)))])[:, np.newaxis]


def _likelihood(e: Floats, kappa: Floats) -> Floats:
    """Likelihood of kappa = 1 / (1 + tau^2 zeta^2) (T, S), for each number (T, S, n).

    Given kappa, the observation is N(0, 1 / kappa), and the true number is N((1 - kappa) e, 1 - kappa).
    """
    log = np.log(kappa)[:, :, np.newaxis] / 2 - kappa[:, :, np.newaxis] * _shrink_factor(e) ** 2 / 2
    return np.asarray(np.maximum(np.exp(log - log.max(axis=(0, 1))), _TINY))


def _half_cauchy(n: int) -> tuple[Floats, Floats]:
    """Quadrature points and weights (n,) of the half Cauchy distribution."""
    x = np.exp(np.linspace(-_MAX_LOG, _MAX_LOG, n))
    weight = 1 / (x + 1 / x)
    return x, weight / weight.sum()


def _shrink_factor(e: Floats) -> Floats:
    return np.asarray(np.clip(e, -_MAX_SIGMAS, _MAX_SIGMAS))
