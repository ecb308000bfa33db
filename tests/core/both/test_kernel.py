"""Angle and speed in one sample: the kernel is the transcription, and psi the derivative."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.kernel.state import COUNTERS2
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.monitoring.axis_monitor import AxisMonitor
from tests.core.both.axes import CASES, Case, samples
from tests.core.differences import worst
from tests.core.oracle.paper import Paper
from tests.core.oracle.prediction import prediction


@pytest.mark.parametrize("joint", [False, True], ids=["paper", "joint and walking"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_kernel_equals_the_transcription(
    case: Case, joint: bool, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rec = samples(seed, case, 400)
    rec.y2[300], rec.y[350] = 50.0, rec.y[350] + 1.0  # an outlier of each
    s = case.settings(outlier=6.0, floor=0.05, starved=0.05, joint=joint, drift=joint)
    paper = Paper(case.model, s)
    paper.run(*rec)
    for fewest in (1, 1000):  # lanes, and one by one
        monkeypatch.setattr(bank_module, "FEWEST_LANES", fewest)
        monitor = AxisMonitor.alone(case.model, s)
        _, trace = monitor.run_traced(*rec[:3], y2=rec.y2)
        differences = worst(trace, paper.log)
        assert max(differences.values()) < 1e-8, differences
        counted = monitor.facts().counters
        assert [counted[name] for name in COUNTERS2] == [paper.second.missing, paper.second.outliers]
        assert counted["second_outlier"] + counted["outlier"] >= 1
        assert counted["outlier"] == paper.outliers


def test_P0_is_found_with_both(seed: int) -> None:
    case = CASES[0]
    s, rec = case.settings(P0=(), lam=0.98), samples(seed, case, 900, jitter=0)
    monitor = AxisMonitor.alone(case.model, s)
    paper = Paper(case.model, s, P_start=monitor.bank.state.P[:, :, 0])
    paper.run(*rec)
    _, trace = monitor.run_traced(*rec[:3], y2=rec.y2)
    assert max(worst(trace, paper.log).values()) < 1e-8
    alone = AxisMonitor.alone(case.model, s)
    alone.run(*rec[:3])
    assert monitor.bank.state.P_nom[0] < 0.95 * alone.bank.state.P_nom[0]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_psi_is_the_derivative_of_the_prediction(case: Case, seed: int) -> None:
    """theta is pinned; the derivative of the whole prediction, corrected by both, by the complex step."""
    rec = samples(seed, case, 300, missing=0.0, jitter=0.0)
    model = case.model
    s = case.settings(settle_s=0.0, P0=tuple(1e-40 * model.scale**2))
    _, trace = AxisMonitor.alone(model, s).run_traced(*rec[:3], y2=rec.y2)
    for i in range(len(model.theta0)):
        step = 1e-30 * model.scale[i]
        psi = (
            np.imag(prediction(model, s, model.theta0 + 1j * step * np.eye(len(model.theta0))[i], *rec))
            / step
        )
        assert np.abs(trace.psi[1:, i] - psi[1:]).max() < 1e-9 * np.abs(psi).max()
