"""theta stays where its predictor is stable."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, slowest_time_constant, stable_limits
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import NOISE, experiment
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

MONITORED = (("kT", "1/Ja", "fm"), ("Jg", "Ja", "dg"), ("r", "kg", "da"), ("1/Jm", "ka", "fm"))


def gain(model: AxisModel, torque_noise: float) -> np.ndarray:
    if torque_noise == 0:
        return np.zeros(len(model.drive.states))
    return filter_gain(model, INTERVAL_S, torque_noise, NOISE[model.drive.output])[0]


def slowest_at(model: AxisModel, i: int, value: float, K: np.ndarray) -> float:
    theta = model.theta0.copy()
    theta[i] = value
    moved = replace(model, nominal=model.values(theta), bounds={})
    return slowest_time_constant(moved, K, INTERVAL_S)


@pytest.mark.parametrize(("output", "torque_noise"), [("speed", 0.0), ("speed", 0.1), ("angle", 0.1)])
@pytest.mark.parametrize("monitored", MONITORED)
def test_bounds_end_where_the_predictor_is_stable(
    output: Output, monitored: tuple[str, ...], torque_noise: float
) -> None:
    """Judged by the time constants of the predictor, another way to the same poles."""
    model = AxisModel(three_mass(output), REFERENCE_VALUES, monitored)
    K = gain(model, torque_noise)
    limits = stable_limits(model, K, INTERVAL_S)
    for side, towards in ((0, -1), (1, 1)):
        for i, own in enumerate(model.limits[side]):
            at = float(limits[side, i])
            assert np.isfinite(slowest_at(model, i, at, K))
            if at != own:
                beyond = at + towards * 0.01 * model.scale[i]
                assert not np.isfinite(slowest_at(model, i, beyond, K))


def test_friction_cannot_drive(seed: int) -> None:
    """Without a gain the reference drive is stable for positive friction only."""
    model = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "1/Ja", "fm"))
    bank = AxisBatch([model], [Settings.paper(INTERVAL_S, P0=(1e-4, 1e-8, 1.0), settle_s=0.0)])
    assert bank.limits[0][2, 0] == pytest.approx(0.0, abs=1e-4)
    monitor = AxisMonitor.of_lane(bank, 0)
    monitor.update(SampleBlock(*experiment(seed, {"fm": -3.0}, samples=2000, fault_at=200)))
    fm = monitor.status().parameters[2]
    assert bank.state.theta[2, 0] >= bank.limits[0][2, 0]
    assert monitor.status().counters["projected"] > 0
    assert monitor.status().counters["diverged"] == 0
    assert np.isnan(fm.estimate) or fm.estimate < 0.5 * fm.nominal


def test_an_unstable_nominal_keeps_its_bounds() -> None:
    model = AxisModel(three_mass("speed"), {**REFERENCE_VALUES, "fm": -0.1}, ("kT", "1/Ja", "fm"))
    np.testing.assert_array_equal(stable_limits(model, np.zeros(5), INTERVAL_S), model.limits)
