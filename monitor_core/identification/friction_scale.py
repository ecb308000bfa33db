"""The speed scale of Coulomb friction: the best of those that come into question, then between its neighbours.

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
"""The search ends where the scale is known to this part, or after so many fits."""
_BEYOND = 2.5
"""Farther than the steepest or flattest scale by this factor; what is tried differs by as much."""
_SIGNIFICANT = 10.83
"""Of a chi-square variable with one degree of freedom, one in a thousand: twice the gain in log likelihood."""
_ALIKE = 1.1
"""Costs so near to the least are alike, and the simulation decides.  Where Coulomb friction takes most of the torque a
simulation says little, and the scale that it likes best may predict far worse."""
_FAILED = 10.0
"""What a fit that fails costs, as a multiple of the best fit: a number, since Brent's search interpolates the costs."""


def with_best_scale(found: Estimate, scales: Sequence[float], fit: Callable[[Problem], Estimate]) -> Estimate:
    """The estimate with the speed scale [rad/s] that explains the records best; none to be tried: as it is.

    Each fit starts from the estimates before.  A scale between those that were tried is kept only where the errors
    fall by more than chance.
    """
    if not scales:
        return found
    tried = [found, *(other for scale in scales if (other := _with_scale(found, scale, fit)))]
    least = min(e.cost for e in tried)
    best = best_of([e for e in tried if e.cost <= _ALIKE * least])
    refined = _refined(best, sorted(e.problem.speed_scale for e in tried), fit)
    if refined is None:
        return best
    # Twice the gain in log likelihood, with errors that are as large as they are after.
    return refined if (best.cost - refined.cost) / refined.lam0 > _SIGNIFICANT else best


def _with_scale(found: Estimate, scale: float, fit: Callable[[Problem], Estimate]) -> Estimate | None:
    """A fit with another scale, from the estimates with this one; None: it fails."""
    try:
        other = fit(replace(found.problem, speed_scale=scale))
    except ValueError:
        return None
    return replace(other, started_from=found.started_from)


def _refined(best: Estimate, tried: Sequence[float], fit: Callable[[Problem], Estimate]) -> Estimate | None:
    """The fit of least cost between the neighbours of the best scale, by Brent's search; None: no fit."""
    k = tried.index(best.problem.speed_scale)
    low = tried[k - 1] if k > 0 else tried[k] / _BEYOND
    high = tried[k + 1] if k + 1 < len(tried) else tried[k] * _BEYOND
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
