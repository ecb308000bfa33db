"""The search: curves that are known, bounds, directions that nothing tells."""

from collections.abc import Callable

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification.greybox.levenberg_marquardt import (
    UNDAMPED,
    NormalEquations,
    Region,
    SearchResult,
    minimise,
)


def search(
    evaluate: Callable[[Floats], NormalEquations],
    start: tuple[float, ...],
    most: int,
    upper: Floats | float = np.inf,
    longest: Floats | float = np.inf,
    clipped: Floats | float = np.inf,
    settled: float = 1e-8,
) -> SearchResult:
    return minimise(evaluate, np.array(start), Region(-np.inf, upper, longest, clipped), most, settled=settled)


def rosenbrock(xi: Floats) -> NormalEquations:
    eps = np.array([10 * (xi[1] - xi[0] ** 2), 1 - xi[0]])
    J = -np.array([[-20 * xi[0], 10], [-1, 0]])
    return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 2)


def test_a_bent_valley() -> None:
    end = search(rosenbrock, (-1.2, 1.0), 200)
    assert end.converged
    np.testing.assert_allclose(end.xi, [1, 1], rtol=1e-6)


def test_a_bound_that_holds_one_lets_the_other_go_on() -> None:
    end = search(rosenbrock, (-1.2, 1.0), 200, upper=np.array([0.5, np.inf]), settled=1e-12)
    assert end.converged
    np.testing.assert_allclose(end.xi, [0.5, 0.25], rtol=1e-6)


def test_no_step_is_longer_than_it_may_be() -> None:
    seen: list[Floats] = []

    def watched(xi: Floats) -> NormalEquations:
        seen.append(xi)
        return rosenbrock(xi)

    search(watched, (-1.2, 1.0), 500, longest=np.array([0.1, np.inf]))
    accepted = [seen[0]]
    for xi in seen[1:]:
        assert abs(xi[0] - accepted[-1][0]) <= 0.1 * (1 + 1e-12)
        if rosenbrock(xi).cost < rosenbrock(accepted[-1]).cost:
            accepted.append(xi)


def test_what_nothing_tells_stays() -> None:
    """The sum of two numbers: their difference remains what it was."""

    def summed(xi: Floats) -> NormalEquations:
        eps, J = np.array([3.0 - xi.sum(), 1e-3]), np.array([[1.0, 1.0], [0.0, 0.0]])
        return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 2)

    end = search(summed, (1.0, -4.0), 50)
    assert end.converged
    assert end.xi.sum() == pytest.approx(3)
    assert end.xi[0] - end.xi[1] == pytest.approx(5)


def test_what_has_vanished_is_not_followed(seed: int) -> None:
    """A level, as its logarithm, that adds exp(2 xi) to the prediction where the data want less: the further down it
    goes the less it matters, but Gauss and Newton expect as much from each step as from the one before."""
    rng = np.random.default_rng(seed)
    S = rng.standard_normal((2000, 2))
    S[:, 1] -= S[:, 1] @ S[:, 0] / (S[:, 0] @ S[:, 0]) * S[:, 0]
    y = 3.0 * S[:, 0] + rng.standard_normal(2000)
    y -= (y @ S[:, 1] / (S[:, 1] @ S[:, 1]) + 0.05) * S[:, 1]

    def levelled(xi: Floats) -> NormalEquations:
        level = np.exp(2 * xi[1])
        eps = y - S @ np.array([xi[0], level])
        J = S * np.array([1.0, 2 * level])
        return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 2000)

    end = search(levelled, (0.0, 0.0), 40, clipped=np.array([np.inf, 1.5]))
    assert end.converged
    assert end.xi[0] == pytest.approx(y @ S[:, 0] / (S[:, 0] @ S[:, 0]))
    assert end.xi[1] < -4


def test_a_cost_that_is_not_finite_is_only_a_step_refused() -> None:
    """A wall of infinities in front of the minimum of the quadratic model."""

    def walled(xi: Floats) -> NormalEquations:
        if xi[0] > 2:
            return NormalEquations(np.inf, np.zeros(1), np.zeros((1, 1)), 1)
        eps, J = np.array([np.exp(-xi[0]), xi[0] - 1.9]), np.array([[np.exp(-xi[0])], [-1.0]])
        return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 2)

    end = search(walled, (-3.0,), 100)
    assert end.converged
    assert 1.9 < end.xi[0] < 2


def test_a_start_that_makes_no_sense() -> None:
    def nowhere(xi: Floats) -> NormalEquations:
        return NormalEquations(np.nan, xi, np.eye(2), 1)

    with pytest.raises(ValueError, match="start values"):
        search(nowhere, (0.0, 0.0), 10)


def test_a_linear_problem_is_solved_by_one_undamped_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J, y, seen = rng.standard_normal((40, 2)), rng.standard_normal(40), list[Floats]()

    def linear(xi: Floats) -> NormalEquations:
        seen.append(xi)
        eps = y - J @ xi
        return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 40)

    end = minimise(linear, 9 * y[:2], Region(), 9, damping=UNDAMPED)
    assert end.converged
    assert len(seen) == 2
    np.testing.assert_allclose(end.xi, np.linalg.lstsq(J, y, rcond=None)[0], rtol=1e-9, atol=1e-10)


def slow(xi: Floats) -> NormalEquations:
    """A curve fitted to what no curve is: the curvature that Gauss and Newton leave out is half of theirs."""
    x, off = float(xi[0]), 1.0
    eps = np.array([x, off * (1 - 0.25 * x * x)])
    J = -np.array([[1.0], [-0.5 * off * x]])
    return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 1000)


def test_the_curvature_that_gauss_and_newton_leave_out_is_learnt(seed: int) -> None:
    """Curves fitted to what no curve is: the steps of Gauss and Newton overshoot by the same factor each time."""
    rng, steps = np.random.default_rng(seed), list[Floats]()
    for _ in range(20):
        directions, truth = rng.standard_normal((4, 3)), rng.standard_normal(3)

        def inexact(xi: Floats, directions: Floats = directions, truth: Floats = truth) -> NormalEquations:
            steps.append(xi)
            x = directions @ (xi - truth)
            eps = np.concatenate([x, 1 + 0.4 * x * x])  # left out: 0.8 of the curvature
            J = -np.concatenate([directions, 0.8 * x[:, np.newaxis] * directions])
            return NormalEquations(float(eps @ eps), J.T @ eps, J.T @ J, 8)

        end = search(inexact, tuple(truth + 0.3 * rng.standard_normal(3)), 100, settled=1e-16)
        assert end.converged
        np.testing.assert_allclose(end.xi, truth, atol=1e-5)
    assert len(steps) <= 20 * 13  # 10 each; without it 21


def test_the_end_of_the_evaluations_is_no_doubt_where_hardly_anything_is_left() -> None:
    """Steps fall off by a factor, as with a model that is not the axis."""
    ends = [search(slow, (0.9,), most) for most in range(2, 40)]
    for end in ends:
        # The step left, squared, in variances.
        left = float(end.normal.g @ end.left) / (end.normal.cost / end.normal.samples)
        assert end.converged == (left <= 1e-3)
    assert not ends[0].converged
    assert ends[-1].converged
    assert np.diff([end.converged for end in ends]).min() >= 0
