"""Mean time between false alarms of a CUSUM test on an estimate with exponential forgetting.

The deviation of such an estimate is autocorrelated like lambda^l.  With its standard deviation sigma as the unit, and
the memory tau, the test  g = max(0, g + d - k),  alarm at  g > h tau,  has the mean time between alarms

    tau / k^2 (e^a - 1 - a),      a = k (h + c)

This is the formula of Brownian motion with a boundary moved out by c for the overshoot at both ends.  For high
thresholds c is close to twice Milne's length, 2.92; for low ones, which the deviation may cross within its correlation
time, it is smaller.  Both were fitted to simulations (k 0.3 to 2.5, h 0.5 to 14, lambda 0.98 and 0.99): within 15 %.
"""

from collections.abc import Callable

import numpy as np

from monitor_core.arrays import Floats

LEAST_K = 0.02
"""A test with less drift than that, or the wrong way, alarms all the time."""
_HIGHEST = 1e6
_LEAST_H = 1e-3


def boundary(k: Floats, h: Floats) -> Floats:
    """c: shift of the boundary for the overshoot, in the unit of h."""
    return np.asarray(2.9 + 0.25 * k + 0.02 * k**2 - 1.7 * np.exp(-(0.13 + 0.96 * k) * h))


def log_mean_time(k: Floats, h: Floats, tau: Floats) -> Floats:
    """Logarithm of the mean number of samples between two alarms of one test.

    Args:
        k: drift nu over the standard deviation sigma of what is tested.
        h: threshold over sigma tau.
        tau: memory, in samples: the long-run variance is 2 sigma^2 tau.
    """
    k = np.maximum(k, LEAST_K)
    a = k * (h + boundary(k, h))
    # e^a - 1 - a, which overflows and, for small a, cancels.
    grown = np.where(a < 30, np.log(np.maximum(np.expm1(np.minimum(a, 30)) - a, 1e-300)), a)
    return np.asarray(np.log(tau) - 2 * np.log(k) + grown)


def log_single(k: Floats, h: Floats) -> Floats:
    """Logarithm of the number of excursions of g from zero beyond h per alarm at h.

    After an alarm the sum restarts while the deviation is still large, and often reaches h again; an excursion to 2 h
    counts once.  Fitted to simulations (k 0.3 to 1.4): within 6 % from h = 1.5 on.
    """
    k = np.maximum(k, LEAST_K)
    return np.asarray(np.log1p(-np.exp(-(0.7 + 0.3 * k) * k * np.maximum(h, _LEAST_H))))


def threshold(k: float, log_samples: float, tau: float) -> float:
    """h, over sigma tau, with a mean time between alarms of e^log_samples samples; 0 where any threshold gives more."""

    def excess(h: float) -> float:
        return float(log_mean_time(np.array(k), np.array(h), np.array(tau))) - log_samples

    return 0.0 if excess(0.0) >= 0 else root(excess, 0.0, _HIGHEST)


def root(f: Callable[[float], float], low: float, high: float, xtol: float = 2e-12) -> float:
    """Root of f, which has different signs at low and high."""
    from scipy.optimize import brentq  # costs the daemon half a second, which never calls it

    return float(brentq(f, low, high, xtol=xtol))
