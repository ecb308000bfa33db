"""Levenberg and Marquardt's method within bounds, on normal equations, with a learnt second-order term."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

_HIDDEN = 1e-13
"""Eigenvalues of the scaled J'J below this share of the largest are rounding errors: no step goes in that direction."""
_SETTLED = 1e-8
"""The search ends when the square of the remaining step, in standard deviations of the estimate, is below this.  With
1e-6 a fit takes a fifth fewer evaluations, but one of six axes of ten minutes stopped in a curved valley, at half of
the simulated fit."""
NEARLY = 1e-3
"""The same limit if rounding or the number of evaluations stops the search.  With an inexact model, Gauss-Newton steps
decrease only by a constant factor, and a thirtieth of a standard deviation does not matter."""
_FLAT = 1e-13
"""The search also ends if the cost can fall only by less than this share (data without noise)."""
_NOTHING = 1e-6
"""An entry no longer matters if its longest step changes the sum of squares by less than this, in variances: a noise
level that has almost vanished, or an initial state that affects no error."""
_DAMPING = 1.0
UNDAMPED = 1e-12
_LEAST_DAMPING = 1e-3
"""Least damping after a step that was worse; with less the next step would hardly differ."""
_MOST_DAMPING = 1e12
STEP = 0.3
"""Longest step of a logarithm.  With this and the initial damping, 25 of 25 fits of the reference drive from values
wrong by 30 % ended at the optimum, in 11 evaluations; with little damping and steps of 1.5, 21 did, in 15."""


class NormalEquations(NamedTuple):
    """Sum of squares, and its Gauss-Newton model: cost(xi + s) = cost - 2 g's + s'H s."""

    cost: float
    g: Floats  # (P,) J' eps, J = d yhat / d xi
    H: Floats  # (P, P) J' J
    samples: int


class Region(NamedTuple):
    """Limits of a search: one number for all entries, or (P,); infinite: no limit."""

    lower: Floats | float = -np.inf
    upper: Floats | float = np.inf
    longest: Floats | float = np.inf
    """Largest change of an entry in one step; a longer step is shortened as a whole"""
    clipped: Floats | float = np.inf
    """Largest change of an entry in one step; only this entry is clipped"""


class SearchResult(NamedTuple):
    """Vector at the end of the search, and the remaining Gauss-Newton step ``left`` (P,)."""

    xi: Floats
    normal: NormalEquations
    evaluations: int
    converged: bool
    left: Floats


def minimise(
    evaluate: Callable[[Floats], NormalEquations],
    xi: Floats,
    region: Region,
    most: int,
    progress: Callable[[int, float], None] | None = None,
    damping: float = _DAMPING,
    settled: float = _SETTLED,
) -> SearchResult:
    """Minimise from xi.  A cost that is not finite only rejects the step.

    Args:
        evaluate: gives the model at a vector.
        xi: start (P,), inside the bounds.
        region: bounds and longest steps.
        most: largest number of evaluations.
        progress: called with the number of evaluations and the cost whenever the cost has fallen.
        damping: damping of the first step, in units of the curvature; UNDAMPED if the problem is nearly linear.
        settled: limit of the square of the remaining step, in standard deviations of the estimate.

    Raises:
        ValueError: the cost at the start is not finite.
    """
    at, mu, grow, second = evaluate(xi), damping, 2.0, _SecondOrder(xi.size)
    if not np.isfinite(at.cost):
        raise ValueError("the predictor is unstable at the start values, or these are not valid")
    steps = _Steps(xi, at, region)
    for count in range(1, most):
        left = steps.damped(0.0)
        if _settled(at, left, settled):
            return SearchResult(xi, at, count, True, left)
        model = steps.with_second_order(second.S) if second.is_better else steps
        wanted = model.damped(mu)
        step = wanted / max(1.0, float(np.max(np.abs(wanted) / region.longest, initial=0.0)))
        new = np.clip(xi + np.clip(step, -region.clipped, region.clipped), region.lower, region.upper)
        trial = evaluate(new)
        gain = at.cost - trial.cost
        expected = model.expected(new - xi)
        second.compare(at, new - xi, gain)
        if gain > 0 and np.isfinite(trial.cost):
            agrees = min(gain / expected, 1.0) if expected > 0 else 0.0
            mu = max(mu * max(1 / 10, 1 - (2 * agrees - 1) ** 3), 1e-15)
            flat = gain <= _FLAT * at.cost and np.array_equal(new, xi + wanted)
            second.learn(at, trial, new - xi)
            xi, at, grow = new, trial, 2.0
            steps = _Steps(xi, at, region)
            if progress:
                progress(count, at.cost)
            if flat:
                return SearchResult(xi, at, count + 1, True, steps.damped(0.0))
        else:
            mu, grow = max(mu * grow, _LEAST_DAMPING), grow * 2
            if mu > _MOST_DAMPING or 0 <= expected <= _FLAT * at.cost:
                if model is not steps:  # what was learnt may be wrong here
                    mu, grow, second = damping, 2.0, _SecondOrder(xi.size)
                    continue
                return SearchResult(xi, at, count + 1, _settled(at, left, NEARLY), left)
    left = steps.damped(0.0)
    return SearchResult(xi, at, most, _settled(at, left, NEARLY), left)


def _settled(at: NormalEquations, left: Floats, limit: float) -> bool:
    """Whether the remaining step is negligible compared with the standard deviation, which cost / samples scales."""
    return float(at.g @ left) <= limit * at.cost / max(at.samples, 1)


class _SecondOrder:
    """S (P, P): the second-order term -sum eps d psi / d xi of the curvature H + S, which Gauss-Newton steps leave out.

    With an inexact model it is not small, and steps without it overshoot or fall short by the same factor each time.
    It is learnt from the changes of the gradient, and used where it predicts the cost better (Dennis, Gay and Welsch
    1981, NL2SOL).
    """

    def __init__(self, size: int) -> None:
        self.S: Floats = np.zeros((size, size))
        self.is_better = False
        """Whether it predicted the last gain better than H alone"""

    def compare(self, at: NormalEquations, step: Floats, gain: float) -> None:
        """Compare the gain of a step from ``at`` with what is expected of it with and without S."""
        alone, more = float(2 * at.g @ step - step @ at.H @ step), float(step @ self.S @ step)
        if more:
            self.is_better = abs(gain - (alone - more)) < abs(gain - alone)

    def learn(self, before: NormalEquations, after: NormalEquations, step: Floats) -> None:
        """Change S as little as possible so that H + S explains how the gradient has changed over a step."""
        change = before.g - after.g
        along = float(change @ step)
        if not along > 0:
            return
        rest = change - 0.5 * (before.H + after.H) @ step  # what S must give for this step
        S, gives = self.S, abs(float(step @ self.S @ step))
        if gives > 0:
            S = min(1.0, abs(float(step @ rest)) / gives) * S
        off = rest - S @ step
        both = np.outer(off, change)
        self.S = S + (both + both.T) / along - float(off @ step) / along**2 * np.outer(change, change)


class _Eigen(NamedTuple):
    """Eigenvalues and eigenvectors of the curvature for the free entries, scaled to unit H, and g along them."""

    size: Floats
    values: Floats
    vectors: Floats
    along: Floats


class _Steps:
    """Steps from xi with any damping, from one decomposition of the curvature H + S for each set of free entries."""

    def __init__(self, xi: Floats, at: NormalEquations, region: Region, S: Floats | None = None) -> None:
        self._xi, self._at, self._region = xi, at, region
        self._at_lower, self._at_upper = xi <= region.lower, xi >= region.upper
        smallest = np.sqrt(_NOTHING * at.cost / max(at.samples, 1)) / region.clipped
        self._matter = np.sqrt(np.diag(at.H)) > smallest
        self._curvature = at.H if S is None else at.H + S
        self._eigen: dict[bytes, _Eigen] = {}

    def with_second_order(self, S: Floats) -> "_Steps":
        """The steps with S; these, if H + S is not positive definite, so that steps might increase the cost."""
        other = _Steps(self._xi, self._at, self._region, S)
        return other if other._decomposed(self._matter, keep_all=True).values.min(initial=1.0) > _HIDDEN else self

    def expected(self, step: Floats) -> float:
        """The gain that the quadratic model expects of a step."""
        return float(2 * self._at.g @ step - step @ self._curvature @ step)

    def damped(self, mu: float) -> Floats:
        """(H + S + mu diag H)^-1 g; entries that would immediately leave bounds, or do not matter, do not move."""
        free = self._matter.copy()
        while True:
            step = self._unbounded(free, mu)
            leaves = (self._at_lower & (step < 0)) | (self._at_upper & (step > 0))
            if not leaves.any():
                return step
            free &= ~leaves

    def _unbounded(self, free: NDArray[np.bool_], mu: float) -> Floats:
        """The step of the free entries, without directions that the curvature does not determine."""
        key = free.tobytes()
        if key not in self._eigen:
            self._eigen[key] = self._decomposed(free)
        size, values, vectors, along = self._eigen[key]
        out = np.zeros(free.size)
        out[free] = vectors @ (along / (values + mu)) / size
        return out

    def _decomposed(self, free: NDArray[np.bool_], keep_all: bool = False) -> _Eigen:
        size = np.sqrt(np.diag(self._at.H)[free])
        size[size == 0] = 1.0
        values, vectors = np.linalg.eigh(self._curvature[np.ix_(free, free)] / np.outer(size, size))
        seen = (values > _HIDDEN * values.max(initial=0.0)) | keep_all
        return _Eigen(size, values[seen], vectors[:, seen], vectors[:, seen].T @ (self._at.g[free] / size))
