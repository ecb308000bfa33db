"""Estimates of a healthy axis scatter as reported, and no more than they must (Cramer and Rao).

Reference axes side by side; memories of 1.8 slowest time constants of the predictor, as in the paper's experiment, of
9, and of less than one.
"""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from tests.core.honesty import Honesty, honesty, settings_for, window_variance
from tests.shares import soaked

AXES, MEMORIES = 96, 20
"""As many as 960 independent estimates: the ratio of deviations is known to 2.3 %."""
SOAKED = 0.05
"""What so few may be off by beside the limits that make soak holds."""


def measured(
    torque_noise: float, time_constants: float, seed: int, *, joint: bool = True, floor: float = 0.0
) -> Honesty:
    settings = settings_for("speed", torque_noise, time_constants, joint=joint)
    settings = replace(settings, information_floor=floor, min_excitation=floor)
    found = honesty("speed", torque_noise, settings, seed, AXES, MEMORIES)
    print(f"scatter over reported {found.scatter / found.reported}, over least {found.scatter / found.least}")
    return found


# The floor makes steps smaller and P smaller: together they stay true.
@pytest.mark.parametrize(
    ("torque_noise", "time_constants", "floor", "within"),
    soaked(
        [(0.0, 1.8, 0.0, 0.2), (0.3, 1.8, 0.0, 0.2), (0.3, 9.0, 0.0, 0.1 + SOAKED), (0.3, 1.8, 0.05, 0.2)],
        (0.3, 1.8, 0.05, 0.2),
    ),
    ids=["output error", "innovations", "ample memory", "supervised"],
)
def test_the_reported_standard_deviation_is_true_and_the_least(
    torque_noise: float, time_constants: float, floor: float, within: float, seed: int
) -> None:
    found = measured(torque_noise, time_constants, seed, floor=floor)
    assert (abs(found.scatter / found.reported - 1) < within).all()
    assert (abs(found.scatter / found.least - 1) < 0.2).all()


@pytest.mark.parametrize("time_constants", soaked([0.457, 0.914], 0.457))
def test_memories_below_one_time_constant(time_constants: float, seed: int) -> None:
    found = measured(0.0, time_constants, seed)
    assert ((found.scatter / found.reported > 0.6) & (found.scatter / found.reported < 1.3)).all()


def test_the_bound_of_a_window_is_that_of_least_squares(seed: int) -> None:
    """Monte Carlo on regressors that are given: weighted least squares scatters by this."""
    rng, lam, N = np.random.default_rng(seed), 0.95, 200
    psi = rng.standard_normal((N, 2)) @ [[1.0, 0.5], [0.0, 1.0]]
    weights = lam ** np.arange(N - 1, -1, -1)
    pseudo = np.linalg.solve(psi.T @ (weights[:, np.newaxis] * psi), psi.T * weights)
    estimates: Floats = pseudo @ rng.standard_normal((N, 40_000))
    bound = window_variance(psi[:, :, np.newaxis], lam, np.array([N - 1]))[0, :, 0]
    assert estimates.var(axis=1) == pytest.approx(bound, rel=0.05)  # known to 0.7 %
