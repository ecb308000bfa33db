"""The speed scale of Coulomb friction: the best of some candidates, then refined between its neighbours.

Friction is fc tanh(speed / scale).  The scale is a parameter like others, but with far minima, so that a search starts
from several values.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from scipy.optimize import minimize_scalar

from monitor_core.identification.greybox import Estimate
from monitor_core.identification.problem import Problem
from monitor_core.identification.starting import best_of

_WITHIN, _MOST_FITS = 0.03, 8
"""The search ends when the scale is known to this relative accuracy, or after this number of fits."""
_BEYOND = 2.5
"""The search extends beyond the smallest and largest candidate by this factor, by which candidates differ."""
_SIGNIFICANT = 10.83
"""Least significant value of twice the gain in log likelihood: chi-square with one degree of freedom, 1 in 1000."""
_ALIKE = 1.1
"""Costs within this factor of the smallest count as equal, and the simulation decides.  It must not decide alone: if
Coulomb friction takes most of the torque, a simulation says little, and its best scale may predict far worse."""
_FAILED = 10.0
"""Cost of a fit that fails, as a multiple of the best cost: a finite number, as Brent's search interpolates costs."""


def with_best_scale(found: Estimate, scales: Sequence[float], fit: Callable[[Problem], Estimate]) -> Estimate:
    """The estimate with the speed scale [rad/s] that explains the records best; unchanged if there are no ``scales``.

    Each fit starts from the estimates before.  A scale between the candidates is kept only if it reduces the errors
    significantly.
    """
    if not scales:
        return found
    tried = [found, *(other for scale in scales if (other := _with_scale(found, scale, fit)))]
    least = min(e.cost for e in tried)
    best = best_of([e for e in tried if e.cost <= _ALIKE * least])
    refined = _refined(best, sorted(tried, key=lambda e: e.problem.speed_scale), fit)
    if refined is None:
        return best
    # Twice the gain in log likelihood, with the innovation variance of the refined fit.
    return refined if (best.cost - refined.cost) / refined.lam0 > _SIGNIFICANT else best


def _with_scale(found: Estimate, scale: float, fit: Callable[[Problem], Estimate]) -> Estimate | None:
    """A fit with another scale, from the estimates with this one; None: it fails."""
    try:
        other = fit(replace(found.problem, speed_scale=scale))
    except ValueError:
        return None
    return replace(other, started_from=found.started_from)


def _refined(best: Estimate, tried: Sequence[Estimate], fit: Callable[[Problem], Estimate]) -> Estimate | None:
    """The fit of least cost in the valley of the best scale, by Brent's search; None: no fit.

    The bottom of the valley lies between the neighbours of a candidate, but this need not be the best one: among costs
    that are almost equal the simulation has decided.
    """
    k = next(i for i, e in enumerate(tried) if e is best)
    while (lower := min(range(max(k - 1, 0), min(k + 2, len(tried))), key=lambda i: tried[i].cost)) != k:
        k = lower
    scales = [e.problem.speed_scale for e in tried]
    low = scales[k - 1] if k > 0 else scales[k] / _BEYOND
    high = scales[k + 1] if k + 1 < len(scales) else scales[k] * _BEYOND
    fits: list[Estimate] = []

    def cost(log_scale: float) -> float:
        found = _with_scale(best, float(f"{math.exp(log_scale):.3g}"), fit)
        if found is None or not found.converged:
            return _FAILED * best.cost
        fits.append(found)
        return found.cost

    minimize_scalar(
        cost,
        bounds=(math.log(low), math.log(high)),
        method="bounded",
        options={"xatol": _WITHIN, "maxiter": _MOST_FITS},
    )
    return min(fits, key=lambda found: found.cost, default=None)
