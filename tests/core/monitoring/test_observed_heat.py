"""An unknown heat from the estimates: of two frictions that follow it, one may have changed by a fault."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.monitoring.heat_observer import corrected
from monitor_core.monitoring.lane_status import Deviations

KT, FM, FC = range(3)
SLOPES = np.array([0.0, -0.02, -0.01])
"""Of the nominal values per watt: kT follows no heat"""
HEAT, SD = 7.0, 7.0
SCATTER, ERROR = 0.02, 0.01


def observed(true_heat: float, fault: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """The corrected heat and its standard deviation [W]."""
    d = SLOPES * (true_heat - HEAT) + fault + rng.normal(0.0, np.hypot(SCATTER, ERROR), 3)
    found = Deviations(d, np.eye(3) * SCATTER**2, np.full(3, 0.05), np.full(3, ERROR))
    correction = corrected(np.diag([SD**2, 0.0]), SLOPES, found)
    assert correction is not None
    step, covariance = correction
    return HEAT + float(step.sum()), float(np.sqrt(covariance.sum()))


@pytest.mark.parametrize("true_heat", [1.0, 12.0])
@pytest.mark.parametrize("changed", [KT, FM, FC])
def test_a_change_that_no_heat_explains_leaves_the_heat_to_the_other_friction(
    changed: int, true_heat: float, seed: int
) -> None:
    rng, fault = np.random.default_rng(seed), np.zeros(3)
    fault[changed] = 1.0  # of either friction more than any heat explains, by 20 standard deviations at least
    heats, sds = np.array([observed(true_heat, fault, rng) for _ in range(400)]).T
    used = [i for i in (FM, FC) if i != changed]
    variance = 1 / (1 / SD**2 + np.sum(SLOPES[used] ** 2) / (SCATTER**2 + ERROR**2))
    assert sds == pytest.approx(np.sqrt(variance))
    expected = true_heat + (HEAT - true_heat) * variance / SD**2  # as it was expected at HEAT
    assert abs(heats.mean() - expected) < 5 * np.sqrt(variance / 400)


@pytest.mark.parametrize("fault", [(0.0, 0.6, 0.6), (0.0, 0.0, 0.2)])
def test_what_no_heat_and_no_single_fault_explains_leaves_it_unknown(fault: tuple[float, ...]) -> None:
    """Both frictions have changed; or each of them alone could be that of some heat, and nothing tells which."""
    d = np.array(fault)
    found = Deviations(d, np.eye(3) * SCATTER**2 / 25, np.full(3, 0.05), np.full(3, ERROR / 5))
    assert corrected(np.diag([SD**2, 0.0]), SLOPES, found) is None
