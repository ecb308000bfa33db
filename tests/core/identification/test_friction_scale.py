"""The search for the speed scale of Coulomb friction goes on where some of its fits fail."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from monitor_core.identification.friction_scale import with_best_scale
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import Problem
from tests.core.identification.problems import reference_problem, reference_record

BEST = 3.0


@pytest.fixture(scope="module")
def found() -> Estimate:
    problem = reference_problem(free=("fm",), speed_scale=2.0)
    return fit(problem, [reference_record(5, 500)])


def costs(found: Estimate, fails: Callable[[float], bool]) -> Callable[[Problem], Estimate]:
    """Fits whose cost is least at the best scale, by far more than chance; some fail."""

    def fitted(problem: Problem) -> Estimate:
        if fails(problem.speed_scale):
            raise ValueError("the fit fails")
        return at(found, problem.speed_scale)

    return fitted


def at(found: Estimate, scale: float) -> Estimate:
    cost = found.lam0 * 1e4 * (1 + math.log(scale / BEST) ** 2)
    return replace(found, problem=replace(found.problem, speed_scale=scale), cost=cost, converged=True)


def test_a_scale_that_predicts_far_worse_is_not_taken_for_its_simulation(found: Estimate) -> None:
    """A simulation of an axis that mostly rubs is good or bad by chance."""

    def fitted(problem: Problem) -> Estimate:
        far = problem.speed_scale > 50.0
        other = at(found, problem.speed_scale)
        return replace(other, cost=(1.5 if far else 1.0) * other.cost, simulate=lambda: (80.0 if far else 30.0,))

    first = replace(at(found, 2.0), simulate=lambda: (30.0,))
    assert with_best_scale(first, (1.0, 10.0, 100.0), fitted).problem.speed_scale == pytest.approx(BEST, rel=0.15)


def test_the_search_goes_down_to_the_bottom_of_the_valley(found: Estimate) -> None:
    """A candidate that simulates a little better, though it predicts worse than its neighbour, does not confine it."""

    def fitted(problem: Problem) -> Estimate:
        other = at(found, problem.speed_scale)
        flat = replace(other, cost=other.cost / (1 + 0.99 * math.log(problem.speed_scale / BEST) ** 2))
        return replace(flat, simulate=lambda: (98.0 if problem.speed_scale == 0.5 else 96.0,))

    first = fitted(replace(found.problem, speed_scale=0.2))
    assert with_best_scale(first, (0.5, 1.25, 2.0, 12.0), fitted).problem.speed_scale == pytest.approx(BEST, rel=0.1)


@pytest.mark.parametrize("failing", [(0.0, 0.0), (2.01, 2.2), (3.2, 4.9), (2.01, 2.7), (2.01, 4.9)])
def test_failed_fits_are_passed_over(found: Estimate, failing: tuple[float, float]) -> None:
    low, high = failing

    def fails(scale: float) -> bool:
        return low < scale < high

    best = with_best_scale(at(found, 2.0), (1.0, 5.0), costs(found, fails))
    tried = best.problem.speed_scale
    assert not fails(tried)
    if not low < BEST < high:
        assert tried == pytest.approx(BEST, rel=0.15)
