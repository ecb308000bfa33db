"""Monitoring that begins in the middle of a motion: the speed is unknown then, and that is no change of the axis."""

import numpy as np
import pytest

import monitor_core as mc
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, reference_model

SPEED, NOISE = 100.0, 1e-4
"""rad/s; rad: an interval at that speed is five thousand times the noise of the encoder."""
BEGINS = 1_000
"""Sample with which the monitor begins: the axis has long reached its speed."""


@pytest.mark.parametrize("begins", [BEGINS, BEGINS + 7])
def test_it_raises_no_alarm(begins: int, seed: int) -> None:
    model, rng = reference_model("angle"), np.random.default_rng(seed)
    settings = mc.recommended_settings(model, INTERVAL_S, mc.MonitoringOptions(torque_noise=0.5, output_noise=NOISE))
    u = SPEED * model.nominal["fm"] + rng.normal(0, 0.5, 3 * BEGINS)
    y = simulate_linear(model.drive, model.nominal, u[:, np.newaxis], INTERVAL_S)[0][:, 0]
    y += rng.normal(0, NOISE, len(y))
    t_us = np.arange(len(y), dtype=np.int64) * round(1e6 * INTERVAL_S)
    detector = mc.MultiModelDetector(model, settings, mc.MultiModelThresholds(samples=1e7))
    monitor = mc.AxisMonitor(model, settings, detector, "multimodel")
    alarms = list(monitor.update(mc.SampleBlock(t_us[begins:], u[begins:], y[begins:])))
    assert alarms == []
    assert detector.bank.tested_samples > BEGINS / 2
