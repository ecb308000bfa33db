"""theta in units of nominal: the same monitor, told in other numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from tests.core.cases import CASES, Case, as_columns, record

OFFSET = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "1/Ja", "tau0"), {"tau0": 0.2})


def test_a_healthy_parameter_is_one_and_an_offset_of_scale_zero() -> None:
    relative = replace(OFFSET, relative=True)
    assert relative.theta0.tolist() == [1.0, 1.0, 0.0]
    assert relative.scale.tolist() == [1.0, 1.0, 1.0]
    assert np.allclose(relative.limits, [[0.1, 0.1, -10.0], [10.0, 10.0, 10.0]])
    assert [p.unit for p in relative.parameters] == ["1", "1", "1"]
    assert relative.parameters[1].meaning == "relative to nominal: reciprocal of: inertia of the arm"


def test_values_are_in_si_again() -> None:
    values = replace(OFFSET, relative=True).values([1.1, 2.0, 0.5])
    assert values["kT"] == pytest.approx(1.1)
    assert values["Ja"] == pytest.approx(REFERENCE_VALUES["Ja"] / 2)
    assert values["tau0"] == pytest.approx(0.1)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_monitor_is_the_same_in_other_units(case: Case, seed: int) -> None:
    """Deviations in units of nominal, P and g with them; the prediction errors are those of SI."""
    N = 400
    relative = replace(case.model, relative=True)
    s, unit = case.settings(), relative.unit
    P0 = tuple(np.asarray(s.P0) / unit**2) if s.P0 else ()
    t, u, y = (column[:, 0] for column in as_columns(record(seed, case, N)))
    _, si = AxisMonitor(case.model, s).update_traced(
        SampleBlock(t.astype(np.int64), u.astype(float), y.astype(float))
    )
    monitor = AxisMonitor(relative, replace(s, P0=P0))
    _, rel = monitor.update_traced(SampleBlock(t.astype(np.int64), u.astype(float), y.astype(float)))
    assert np.allclose(rel.eps, si.eps, rtol=1e-7, atol=1e-9 * np.nanmax(np.abs(si.eps)), equal_nan=True)
    assert np.allclose(rel.theta * unit, si.theta, rtol=1e-7)
    assert np.allclose(rel.P * unit**2, si.P, rtol=1e-6)
    assert np.allclose(rel.g * unit, si.g, rtol=1e-6, atol=1e-7 * unit)
