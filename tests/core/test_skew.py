"""A skew between torque and speed is seen as what it is, not as an inertia."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.detection import Crossing
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, Experiment
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisBatch
from monitor_core.settings import Settings
from tests.core.figures import side_by_side, steady_p

H, FINE = 0.005, 10
SAMPLES, LATE_FROM = 4000, 2000
NOISE, TORQUE_NOISE = 0.3, 0.1
SEEDS = 24
DELAYED = three_mass("speed").with_delay()


def records(seed: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """u and y (N, SEEDS); from LATE_FROM on the torque acts so many tenths of an interval late, or (< 0) early."""
    rngs = [np.random.default_rng((seed, k)) for k in range(SEEDS)]
    u = np.stack([multisine(r, SAMPLES, H, BAND_HZ, TORQUE_RMS) for r in rngs], axis=1)
    noise = TORQUE_NOISE * np.stack([r.standard_normal(SAMPLES) for r in rngs], axis=1)
    acting = np.repeat(u + noise, FINE, axis=0)
    shifted = np.roll(acting, steps, axis=0)
    acting = np.concatenate([acting[: LATE_FROM * FINE], shifted[LATE_FROM * FINE :]])
    y, _ = simulate_linear(three_mass("speed"), REFERENCE_VALUES, acting, H / FINE)
    return u, y[::FINE] + NOISE * np.stack([r.standard_normal(SAMPLES) for r in rngs], axis=1)


def watched(
    monitored: tuple[str, ...], u: np.ndarray, y: np.ndarray
) -> tuple[AxisBatch, list[tuple[int, Crossing]]]:
    if "delay" in monitored:
        nominal = {**REFERENCE_VALUES, "delay": 0.0}
        model = AxisModel(DELAYED, nominal, monitored, {"delay": H / 10}, {"delay": (-H, H)})
    else:
        model = AxisModel(three_mass("speed"), REFERENCE_VALUES, monitored)
    K, lam0 = filter_gain(model, H, TORQUE_NOISE, NOISE)
    settings = Settings.paper(
        H, K=tuple(K), lam0=lam0, settle_s=2.0, information_floor=0.05, min_excitation=0.05
    )
    settings = replace(settings, P0=steady_p(model, settings, range(20)))
    bank, events, _ = side_by_side(model, settings, Experiment(np.arange(SAMPLES) * 5000, u, y))
    return bank, [(a, e) for a, e in events if isinstance(e, Crossing)]


@pytest.mark.parametrize("steps", [1, -1, 5], ids=["0.5 ms late", "0.5 ms early", "2.5 ms late"])
def test_a_skew_is_named_and_measured(steps: int, seed: int) -> None:
    bank, crossings = watched(("1/Jm", "fm", "delay"), *records(seed, steps))
    firsts = dict(reversed(crossings))
    assert len(firsts) > SEEDS / 2
    assert {e.parameter for e in firsts.values()} == {"delay"}
    assert {e.direction for e in firsts.values()} == {"up" if steps > 0 else "down"}
    assert all(e.time_us > LATE_FROM * 5000 for _, e in crossings)
    estimates = bank.state.theta[2]
    assert np.mean(estimates) == pytest.approx(
        steps * H / FINE, rel=0.1 if steps > 0 else 0.4
    )  # early: first order


def test_unseen_it_would_be_an_inertia(seed: int) -> None:
    """2.5 ms read as seven percent of the motor's inertia."""
    bank, _ = watched(("1/Jm", "fm"), *records(seed, 5))
    assert np.mean(bank.state.theta[0]) / bank.models[0].theta0[0] < 0.96
