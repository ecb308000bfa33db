"""Thresholds that keep a false-alarm budget, and their false-alarm rate with its uncertainty."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.calibration.false_alarm_tail import Tail
from monitor_core.calibration.scatter import Scatter
from monitor_core.settings import ALLOWED, Threshold

CONFIDENCE = 0.90
LOWER, UPPER = (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
LEAST_H, LEAST_NU, MOST_NU = 0.5, 0.3, 2.5
"""Bounds within which the run-length formula holds: of h over (sigma memory), and of nu over sigma."""
_OFF, _FARTHER = 0.03, 0.03
"""Standard deviation of the error of the formula, in the log rate: a constant part, and a part for each factor e by
which the rate is extrapolated."""
_NEAR = 0.02
"""Accuracy of logarithms of rates."""


@dataclass(frozen=True)
class Rates:
    """False alarms per sample: by parameter (p,), total, and the 90 % interval of the total.

    The rates hold for axes whose nominal values have an error as large as the allowance.  Only the lower bound holds
    for axes without such an error.
    """

    parameters: Floats
    total: float
    lower: float
    upper: float
    beyond: float
    """Largest factor by which a rate is extrapolated below the simulated rates"""


def best_nu(log_time: float, within: float) -> float:
    """nu over sigma with which the smallest possible change is found within ``within`` memories.

    A change of delta sigma is found after (h + delta) / (delta - k) memories.  Here h = A / k - c keeps the budget, and
    A is ``log_time``: the log of the mean time between false alarms, in memories.  The smallest delta that is found in
    time has k^2 = A / (within - 0.25), as c grows by 0.25 k.
    """
    return float(np.clip(math.sqrt(log_time / max(within - 0.25, 0.1)), LEAST_NU, MOST_NU))


def nu_over_sigma(parameters: int, memory: float, samples: float, within: float) -> float:
    """``best_nu`` of each test, for a budget of one false alarm of the axis in ``samples``."""
    return best_nu(math.log(max(2 * parameters * samples / memory, math.e)), within)


def thresholds(
    scatter: Scatter, tails: tuple[Tail, ...], allowance: Floats, samples: float, rng: np.random.Generator
) -> tuple[Threshold, ...]:
    """Thresholds with which an axis has at most one false alarm in ``samples`` on average.

    Every parameter gets the same share of the budget.  The upper bound of the 90 % interval of the rate of the axis
    keeps the budget.  The allowance (p,), in sizes, covers errors of the estimates beyond their scatter; it does not
    lower a threshold.
    """
    drawn = _DrawnRates(scatter, tails, rng)
    log_budget, log_share = -math.log(samples), -math.log(samples * len(tails))

    def h_for(log_share: float) -> list[float]:
        return [drawn.threshold(i, log_share) for i in range(len(tails))]

    def excess(less: float) -> float:
        return drawn.bound(UPPER, h_for(log_share - less)) - log_budget

    # The bound of a sum of widely scattered rates differs from the sum of their bounds: correct the shares for that.
    less = root(excess, -3.0, 3.0, xtol=_NEAR) if excess(-3.0) > 0 > excess(3.0) else 0.0
    # The scatter of a single parameter contains what differs between parts of the records.
    parts = (allowance - scatter.beyond) / ALLOWED
    own_scatter = np.maximum(_scatter_of_its_own(scatter), parts**2)
    error = np.sqrt(scatter.mean_d**2 + scatter.off.var(axis=0) + own_scatter)
    return tuple(
        Threshold(tail.nu / float(scatter.mean_s[i]), h, float(allowance[i]), float(error[i]))
        for i, (tail, h) in enumerate(zip(tails, h_for(log_share - less), strict=True))
    )


def _scatter_of_its_own(scatter: Scatter) -> Floats:
    """Variance (p,) of each estimate that neither P nor the scatter of all parameters together explains.

    The tests follow the scatter of each parameter, but a name and a size are weighed by P times one factor for all.
    What the drive lacks may move a single parameter, as ``load`` from program to program: by P alone its deviations
    would be better evidence than a large change of another one.  Only what chance does not explain counts.
    """
    by_p = scatter.mean_s**2
    surely = scatter.sigma**2 * np.quantile(scatter.power, LOWER, axis=0)
    return np.asarray(np.maximum(surely - by_p * np.mean(scatter.sigma**2 / by_p), 0.0))


def rates(scatter: Scatter, tails: tuple[Tail, ...], own: tuple[Threshold, ...], rng: np.random.Generator) -> Rates:
    """False-alarm rate of these thresholds on axes like that of the healthy records, with or without its errors."""
    h = [threshold.alpha2 for threshold in own]
    likely = np.array([tail.most_likely(h[i], float(scatter.offset[i])) for i, tail in enumerate(tails)])
    beyond = max(tail.log_known - rate for tail, rate in zip(tails, likely, strict=True))
    drawn = _DrawnRates(scatter, tails, rng)
    spare = np.array([threshold.allowance for threshold in own]) - scatter.beyond
    lower = math.exp(drawn.bound(LOWER, h, np.maximum(spare, 0.0)))
    upper = math.exp(drawn.bound(UPPER, h))
    parameters = np.exp(likely)
    return Rates(parameters, float(parameters.sum()), lower, upper, math.exp(max(0.0, float(beyond))))


class _DrawnRates:
    """Draws (B,) of the rate of each parameter: one for each resampling of the records."""

    def __init__(self, scatter: Scatter, tails: tuple[Tail, ...], rng: np.random.Generator) -> None:
        self._scatter, self._tails = scatter, tails
        # Standard normal (p, B, 5): two for each direction of the tail, one for the formula.
        self._draws = rng.standard_normal((len(tails), len(scatter.power), 5))

    def _log_rates(self, i: int, h: float, spare: float = 0.0) -> Floats:
        """Logarithms (B,) of the rate of a parameter."""
        scatter, tail, draws = self._scatter, self._tails[i], self._draws[i]
        offset = scatter.offset[i] + scatter.off[:, i]
        rate = tail.log_rate(h, offset, scatter.power[:, i], spare, draws[:, :4])
        sd = _OFF + _FARTHER * max(0.0, tail.log_known - float(np.median(rate)))
        return np.asarray(rate + sd * draws[:, 4])

    def bound(self, q: float, h: Sequence[float], spare: Floats | None = None) -> float:
        """Quantile of the logarithm of the rate of the axis."""
        spared = np.zeros(len(h)) if spare is None else spare
        each = [self._log_rates(i, h[i], float(spared[i])) for i in range(len(h))]
        return float(np.quantile(np.logaddexp.reduce(each, axis=0), q))

    def threshold(self, i: int, log_share: float) -> float:
        """h of a parameter, in sizes times samples, whose rate stays below its share with the certainty ``UPPER``."""
        least = LEAST_H * self._tails[i].sigma * self._scatter.memory

        def excess(log_h: float) -> float:
            return float(np.quantile(self._log_rates(i, math.exp(log_h)), UPPER)) - log_share

        low = math.log(least)
        high = low + 12
        if excess(low) <= 0:
            return least
        return math.exp(root(excess, low, high, xtol=_NEAR / 20)) if excess(high) < 0 else math.inf


def root(f: Callable[[float], float], low: float, high: float, xtol: float = 2e-12) -> float:
    """Root of f, which has different signs at low and high."""
    # Not at the top: the daemon never calls it, and the import takes half a second.
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=xtol))


def bisected(is_below: Callable[[Floats], Bools], low: Floats, high: Floats, halvings: int) -> Floats:
    """Points (H,) up to which ``is_below`` holds: upper ends of [low, high] after this number of halvings."""
    for _ in range(halvings):
        middle = (low + high) / 2
        below = is_below(middle)
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return high
