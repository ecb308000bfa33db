"""Tail of the CUSUM sums of a test: the run-length formula, fitted to excursions in bootstrap copies of records.

The deviation of an estimate with exponential forgetting is autocorrelated like lambda^l.  With its standard deviation
sigma as the unit, and the memory tau, the test  g = max(0, g + d - k),  alarm at  g > h tau,  has the mean time between
alarms

    tau / k^2 (e^a - 1 - a),      a = k (h + c)

This is the formula of Brownian motion with a boundary moved out by c for the overshoot at both ends.  For high
thresholds c is close to twice Milne's length, 2.92; for low ones, which the deviation may cross within its correlation
time, it is smaller.  Both were fitted to simulations (k 0.3 to 2.5, h 0.5 to 14, lambda 0.98 and 0.99): within 15 %.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.copy_excursions import Excursions
from monitor_core.calibration.scatter import Scatter

_ALARMING_K = 0.02
"""With a smaller drift, or a negative one, a test alarms all the time."""
_LEAST_H = 1e-3


def log_mean_time(k: Floats, h: Floats, tau: Floats) -> Floats:
    """Logarithm of the mean number of samples between two alarms of one test.

    Args:
        k: drift nu over the standard deviation sigma of the tested deviation.
        h: threshold over sigma tau.
        tau: memory, in samples: the long-run variance is 2 sigma^2 tau.
    """
    k = np.maximum(k, _ALARMING_K)
    c = 2.9 + 0.25 * k + 0.02 * k**2 - 1.7 * np.exp(-(0.13 + 0.96 * k) * h)
    a = k * (h + c)
    # e^a - 1 - a, which overflows and, for small a, cancels.
    grown = np.where(a < 30, np.log(np.maximum(np.expm1(np.minimum(a, 30)) - a, 1e-300)), a)
    return np.asarray(np.log(tau) - 2 * np.log(k) + grown)


def log_single(k: Floats, h: Floats) -> Floats:
    """Logarithm of the number of excursions of g from zero beyond h per alarm at h.

    After an alarm the sum restarts while the deviation is still large, and often reaches h again; an excursion to 2 h
    counts once.  Fitted to simulations (k 0.3 to 1.4): within 6 % from h = 1.5 on.
    """
    k = np.maximum(k, _ALARMING_K)
    return np.asarray(np.log1p(-np.exp(-(0.7 + 0.3 * k) * k * np.maximum(h, _LEAST_H))))


MAX_EXCURSIONS, MIN_EXCURSIONS = 300, 15
"""Largest number of highest excursions that are used; with fewer than the second number the rate is the formula's."""
LEAST_H = 1.0
"""Lowest threshold, in sigma times memory, at which the formula is accurate enough to be fitted."""
TAU_SD, LEVEL_SD = 0.2, 0.2
"""Prior standard deviations of the logs of memory and rate, around those of white noise."""
_MAX_PRIOR_SIGMAS = 2.0
"""Prior standard deviations.  If a fit to few excursions is farther away than this, the formula does not hold at their
low thresholds.  They then contain no information about higher thresholds, and the prior is used."""
_STEP, _TINY = 1e-3, 1e-300
_LEAST_K = 0.1


class PeakFit(NamedTuple):
    """Fit of one direction: log of the memory, and log of the rate relative to the formula with this memory."""

    best: Floats  # (2,)
    root: Floats  # (2, 2) L, with the covariance L L'


@dataclass(frozen=True)
class Tail:
    """False-alarm rate of one parameter as a function of the threshold."""

    k: float
    """nu over sigma of the simulation, and of the test"""
    sigma: float
    """Standard deviation in the records, in sizes"""
    ways: tuple[PeakFit, PeakFit]
    """Fits for an increase and for a decrease"""
    log_known: float
    """Logarithm of the lowest rate per sample, of one direction, that the simulation determines well"""

    @property
    def nu(self) -> float:
        """Drift of the test, in sizes."""
        return self.k * self.sigma

    def most_likely(self, h: float, offset: float) -> float:
        """``log_rate`` at the most likely fit."""
        return float(self.log_rate(h, np.array([offset]), np.ones(1))[0])

    def log_rate(
        self, h: float, offset: Floats, power: Floats, spare: float = 0.0, chance: Floats | None = None
    ) -> Floats:
        """Logarithm (B,) of the false alarms per sample of both directions.

        Args:
            h: threshold, in sizes times samples.
            offset: mean of the deviation, in sizes (B,).
            power: variance of the deviation over that of the records (B,).
            spare: part of the allowance that the offset of the axis does not use up, in sizes.
            chance: standard normal (B, 4), for the uncertainty of memory and rate of both directions; None: the
                most likely values.
        """
        sigma = self.sigma * np.sqrt(power)
        apart = np.zeros((1, 4)) if chance is None else chance
        sides = []
        for d, (sign, way) in enumerate(zip((1, -1), self.ways, strict=True)):
            log_tau, level = (way.best + apart[:, 2 * d : 2 * d + 2] @ way.root.T).T
            tau = np.exp(log_tau)
            k = (self.nu + spare - sign * offset) / sigma
            sides.append(level - log_mean_time(k, h / (sigma * tau), tau))
        return np.asarray(np.logaddexp(*sides))


def tails(scatter: Scatter, found: Excursions) -> tuple[Tail, ...]:
    """Tail of the sums of each parameter."""
    return tuple(_tail(i, scatter, found) for i in range(len(scatter.sigma)))


def _tail(i: int, scatter: Scatter, found: Excursions) -> Tail:
    k, sigma = float(found.k[i]), float(found.sigma[i])
    off = float(found.mean[i]) / sigma
    heights = [ways[i] / (sigma * scatter.memory) for ways in found.largest]
    up, down = (
        fit_peaks(max(k - sign * off, _LEAST_K), side, scatter.memory, found.samples)
        for sign, side in zip((1, -1), heights, strict=True)
    )
    often = min(max(len(side) for side in heights), MIN_EXCURSIONS)
    return Tail(k, float(scatter.sigma[i]), (up, down), math.log(max(often, 1) / found.samples))


def fit_peaks(k: float, heights: Floats, memory: float, samples: float) -> PeakFit:
    """Memory and rate of one direction from the peaks of its excursions in ``samples`` samples.

    The excursions are a Poisson process; the posterior is approximated by Laplace's method.

    Args:
        k: (nu - mean) / sigma in this direction.
        heights: the peaks over sigma times memory, in falling order.
        memory: memory of the recursion [samples], which holds for white innovations.
        samples: number of samples with these excursions.
    """
    from scipy.optimize import minimize  # as in budget.py

    h = heights[: min(MAX_EXCURSIONS, int((heights > LEAST_H).sum()))]
    known = np.array([TAU_SD, LEVEL_SD])
    base = np.array([float(h[-1]) if len(h) == MAX_EXCURSIONS else LEAST_H])
    around = np.concatenate([h * (1 - _STEP), h * (1 + _STEP)])

    def log_count(at: Floats, apart: Floats) -> Floats:
        x, tau = at / math.exp(apart[0]), np.array(memory * math.exp(apart[0]))
        often = log_single(np.array(k), x) - log_mean_time(np.array(k), x, tau)
        return np.asarray(math.log(samples) + apart[1] + often)

    def loss(apart: Floats) -> float:
        """Negative log of the posterior density."""
        lower, upper = np.exp(np.split(log_count(around, apart), 2))
        of_heights = np.log(np.maximum(lower - upper, _TINY)).sum()
        prior = ((apart / known) ** 2).sum() / 2
        return float(np.exp(log_count(base, apart)).sum() - of_heights + prior)

    simplex = np.vstack([np.zeros(2), 100 * _STEP * np.eye(2)])
    best: Floats = minimize(loss, np.zeros(2), method="Nelder-Mead", options={"initial_simplex": simplex}).x
    if len(h) < MIN_EXCURSIONS and (abs(best) > _MAX_PRIOR_SIGMAS * known).any():
        return PeakFit(np.array([math.log(memory), 0.0]), np.diag(known))
    covariance = np.linalg.inv(_second_derivatives(loss, best))
    return PeakFit(np.array([math.log(memory), 0.0]) + best, np.linalg.cholesky(covariance))


def _second_derivatives(f: Callable[[Floats], float], x: Floats) -> Floats:
    """Second derivatives of f at x."""
    d = _STEP * np.eye(len(x))
    four = np.array([[(f(x + a + b) - f(x + a - b) - f(x - a + b) + f(x - a - b)) for b in d] for a in d])
    return four / (4 * _STEP**2)
