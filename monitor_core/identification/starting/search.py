"""Searches from values that are wrong by factors for values that give the measured frequency response.

The sum of squares of the relative errors of G has many minima: a resonance of the model that matches the wrong one of
the record stays there.  Three measures guide the search:

* It begins outside of the unit circle (see response.py), where the resonances are broad, and returns in stages.
* A Gaussian prior around the given values holds what a stage does not determine; it is weakened from stage to stage,
  and there is none at the end.
* Where one damper has locked its spring (d -> infinity) or been lost (d -> 0), the others compensate and the search is
  stuck next to the right minimum.  Then all dampers are set to d = T k with one T, and held while the rest converges.

If this fails, the search starts again, around the given values, until the response is explained within its uncertainty,
or the same best values have been found several times.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from monitor_core.arrays import Complexes, Floats
from monitor_core.identification.greybox.levenberg_marquardt import NormalEquations, Region, minimise
from monitor_core.identification.starting.response import Measured, Response, Target

ErrorKind = Literal["linear", "log", "both"]
KINDS: tuple[ErrorKind, ...] = ("linear", "log", "both")
"""Relative errors of G; their logarithm; those of G and of 1/G, which see resonances and anti-resonances alike."""
MOST = 80
"""Largest number of searches, if none of them explains the response."""
_EXPLAINED, _AGAIN = 2, 15
"""Number of ends at the same best values after which the search stops: if they explain the response, and if not."""
_STAGES = (
    (30.0, 100.0),
    (20.0, 100.0),
    (14.0, 50.0),
    (10.0, 30.0),
    (7.0, 20.0),
    (5.0, 10.0),
    (3.0, 5.0),
    (0.0, 1.0),
)
"""Distance from the unit circle, 1/s, and weight of the prior."""
_SUREST = 0.1
"""Lower limit of the relative error of each point before the last stage."""
_FARTHEST = 6.0
"""Largest distance of a logarithm from its start."""
_LONGEST_STEP = 1.5
"""Largest change of a logarithm in one step."""
_STEPS = 30
_LAST_STEPS = 60
_SPREADS = (0.4, 0.6, 0.8, 1.0)
"""Standard deviations of the logarithms of further starts around the given values, used in turn."""
_NUDGES = (0.4, 0.7, 0.4, 1.0, 0.4, 0.7)
"""The same for hops from the end of a search, before the next start."""
_HELD = 1e4
"""Weight of the prior of held parameters."""
_SLACK = 4.0
"""The right model may exceed its expected cost by this number of standard deviations of a chi-square."""
_SAME = 1.02
"""Costs within this factor are of the same minimum."""


class WithCost(Protocol):
    """A result with its cost."""

    @property
    def cost(self) -> float:
        """Sum of squared relative errors over their variances."""


_WithCost = TypeVar("_WithCost", bound=WithCost)


class SearchEnd(NamedTuple):
    """An end of a search: x (p,) and its cost, the sum of squared relative errors over their variances."""

    x: Floats
    cost: float


def explained(measured: Measured) -> float:
    """The cost up to which a model explains the response within its uncertainty."""
    return measured.expected + _SLACK * float(np.sqrt(2 * measured.expected))


def search(
    response: Response, measured: Measured, most: int = MOST, reached: Callable[[int], None] | None = None
) -> tuple[SearchEnd, ...]:
    """The distinct ends of searches from the response's start and around it, the best first.

    There are at most so many, fewer when some have ended at the same best values; ``reached`` gets their number.
    """
    ends = list[SearchEnd]()
    for count, end in enumerate(_ends(response, measured)):
        ends.append(end)
        if reached:
            reached(count + 1)
        best = min(e.cost for e in ends)
        needed = _EXPLAINED if best < explained(measured) else _AGAIN
        if count + 1 >= most or sum(e.cost < _SAME * best for e in ends) >= needed:
            break
    return tuple(distinct(ends))


def _ends(response: Response, measured: Measured) -> Iterator[SearchEnd]:
    """Endless, reproducible sequence: a search from or around the given values, then hops from its end; and so on."""
    rng, first = np.random.default_rng(0), response.start
    for count in itertools.count():
        spread = _SPREADS[(count - 1) % len(_SPREADS)] if count else 0.0
        x = first + spread * rng.standard_normal(first.size)
        best = descend(response, measured, x, KINDS[count % len(KINDS)])
        yield best
        for nudge in _NUDGES:
            end = hop(response, measured, best.x + nudge * rng.standard_normal(first.size))
            best = min(best, end, key=lambda found: found.cost)
            yield end


def distinct(ends: Iterable[_WithCost]) -> Iterator[_WithCost]:
    """The finite ends, sorted by cost, each minimum once."""
    last = 0.0
    for end in sorted(ends, key=lambda e: e.cost):
        if _SAME * last < end.cost < np.inf:
            yield end
            last = end.cost


def hop(response: Response, measured: Measured, x: Floats) -> SearchEnd:
    """A search from x with equal damping of all springs, which is held at first."""
    held = np.zeros(x.size)
    pairs = response.dampers
    if len(pairs):
        damper, spring = pairs.T
        x = x.copy()
        x[damper] = x[spring] + np.median(x[damper] - x[spring])
        held[damper] = _HELD
    x = _minimum(response, measured.target(0.0, _SUREST), "linear", x, _Prior(x, 1.0 + held), _LAST_STEPS).x
    x = _minimum(response, measured.target(), "linear", x, _Prior(x, held), _LAST_STEPS).x
    return polish(response, measured, x)


def descend(response: Response, measured: Measured, x: Floats, kind: ErrorKind) -> SearchEnd:
    """One search from x through all stages."""
    centre = x
    for shift, weight in _STAGES:
        x = _minimum(response, measured.target(shift, _SUREST), kind, x, _Prior(centre, weight), _STEPS).x
    return polish(response, measured, x)


def settle(response: Response, measured: Measured, x: Floats) -> SearchEnd:
    """The minimum next to x: first of a smoother cost and not far away."""
    x = _minimum(response, measured.target(0.0, _SUREST), "linear", x, _Prior(x, 1.0), _STEPS).x
    return polish(response, measured, x)


def polish(response: Response, measured: Measured, x: Floats) -> SearchEnd:
    """The minimum next to x without prior."""
    return _minimum(response, measured.target(), "linear", x, _Prior(x, 0.0), _LAST_STEPS)


class _Prior(NamedTuple):
    """A quadratic cost of each logarithm's distance from ``centre`` (p,)."""

    centre: Floats
    weight: Floats | float


def _minimum(response: Response, target: Target, kind: ErrorKind, x: Floats, prior: _Prior, most: int) -> SearchEnd:
    """The minimum of errors and prior, from x in at most so many steps; of infinite cost if there is none."""
    evaluate = _criterion(response, target, kind, prior)
    region = Region(response.start - _FARTHEST, response.start + _FARTHEST, _LONGEST_STEP)
    try:
        end = minimise(evaluate, np.clip(x, region.lower, region.upper), region, most)
    except ValueError:
        return SearchEnd(x, np.inf)
    return SearchEnd(end.xi, end.normal.cost)


def _criterion(
    response: Response, target: Target, kind: ErrorKind, prior: _Prior
) -> Callable[[Floats], NormalEquations]:
    def evaluate(x: Floats) -> NormalEquations:
        hopeless = NormalEquations(np.inf, np.zeros(x.size), np.eye(x.size), 1)
        with np.errstate(all="ignore"):
            try:
                e, J = errors(kind, target, *response.at(x, target))
            except (np.linalg.LinAlgError, ValueError):
                return hopeless
            away, weight = x - prior.centre, prior.weight
            cost = float(np.sum(np.abs(e) ** 2) + np.sum(weight * away**2))
            g, H = (J.conj().T @ e).real - weight * away, (J.conj().T @ J).real + weight * np.eye(x.size)
        return NormalEquations(cost, g, H, 2 * e.size) if np.isfinite(cost + H.sum()) else hopeless

    return evaluate


def errors(kind: ErrorKind, target: Target, G: Complexes, dG: Complexes) -> tuple[Complexes, Complexes]:
    """Weighted errors (F,) and their slopes (F, p), with the sign of NormalEquations: the error falls by J step."""
    w = target.weight
    ratio: Complexes = target.G / G
    if kind == "log":
        away: Complexes = np.asarray(w * np.log(ratio), dtype=np.complex128)
        return away, (w / G)[:, None] * dG
    e: Complexes = w * (1 - G / target.G)
    J: Complexes = (w / target.G)[:, None] * dG
    if kind == "linear":
        return e, J
    inverse, slopes = w * (ratio - 1), (w * ratio / G)[:, None] * dG
    return np.concatenate([e, inverse]), np.concatenate([J, slopes])


# --- Progress of a search ---------------------------------------------------------------------------------------------


SearchProgress = Callable[[int, int], None]
"""Called with the steps done and how many there are at most; the first only grows, and in the end is the second.

A search that ends early leaves steps out, so the number may leap.
"""


class StepCounter:
    """Reports steps done, each number once.

    Args:
        tell: callback; None: no report.
        total: number of steps.
    """

    def __init__(self, tell: SearchProgress | None, total: int) -> None:
        self._tell, self._of, self._done = tell, total, 0

    def reached(self, done: int) -> None:
        """Report ``done`` steps, if that is new."""
        if self._tell and self._done < done <= self._of:
            self._done = done
            self._tell(done, self._of)

    def part(self, first: int, count: int) -> Callable[[int], None]:
        """A reporter for the ``count`` steps after the ``first`` ones."""
        return lambda done: self.reached(first + min(done, count))
