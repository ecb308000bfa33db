"""The Kalman gain: the limit of the recursion, its innovations white; and theta stays where the predictor is stable."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, gains_after, slowest_time_constant, stable_limits
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import NOISE, experiment
from monitor_core.modeling.standard_drives import (
    INTERVAL_S,
    MONITORED,
    REFERENCE_VALUES,
    reference_model,
    three_mass,
)
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.simulated import simulated
from tests.shares import soaked

H = 0.005


AVERAGED = three_mass("speed").with_mean_speed()
DRIVES = {
    "speed": three_mass("speed"),
    "angle": three_mass("angle"),
    "mean speed": AVERAGED,
    "mean speed, delay": AVERAGED.with_delay(),
}


def axis_model(name: str) -> AxisModel:
    known = {**REFERENCE_VALUES, "delay": 0.0}
    return AxisModel(DRIVES[name], {p.name: known[p.name] for p in DRIVES[name].parameters}, MONITORED)


class Recursion(NamedTuple):
    """The covariance recursion of the book, run until it stands still: P of the prediction, and what it goes by.

    What a mean speed is taken over begins anew with each sample.
    """

    Ad: Floats
    Q: Floats
    C: Floats
    r: float
    P: Floats

    @classmethod
    def run(cls, model: AxisModel, q: float, r: float, steps: int) -> Recursion:
        A, B, C = model.matrices()
        n, c = len(A), C[0] / (H if model.drive.mean_state >= 0 else 1.0)
        exp = expm(H * np.block([[A, B[:, :1]], [np.zeros((1, n + 1))]]))
        Ad, b = exp[:n, :n], exp[:n, n:]
        if model.drive.mean_state >= 0:
            Ad[:, model.drive.mean_state] = 0.0
        recursion = cls(Ad, b @ b.T * q**2, c, r, b @ b.T * q**2)
        for _ in range(steps):
            recursion = recursion.later(recursion.P - np.outer(recursion.gain, recursion.gain) * recursion.S)
        return recursion

    def later(self, P: Floats) -> Recursion:
        P = self.Ad @ P @ self.Ad.T + self.Q
        return self._replace(P=(P + P.T) / 2)

    @property
    def S(self) -> float:
        return float(self.C @ self.P @ self.C + self.r**2)

    @property
    def gain(self) -> Floats:
        return np.asarray(self.P @ self.C / self.S)


@pytest.mark.parametrize(("name", "torque_noise"), soaked(product(DRIVES, (0.01, 0.1, 1.0)), *product(DRIVES, (0.1,))))
def test_gains_are_those_of_the_covariance_recursion(name: str, torque_noise: float) -> None:
    """In its steady state; and from there without its corrections, where samples are missing.

    These are 0, 2, 3 .. intervals, the one after one being the gain itself.
    """
    model, noise = axis_model(name), NOISE[DRIVES[name].output]
    at = Recursion.run(model, torque_noise, noise, 6000)
    K, lam0 = filter_gain(model, H, torque_noise, noise)
    kept = np.arange(len(K)) != model.drive.mean_state
    assert (K[~kept] == 0).all()
    scale = abs(at.gain).max()
    assert K[kept] == pytest.approx(at.gain[kept], rel=1e-5, abs=1e-9 * scale)
    assert lam0 == pytest.approx(at.S, rel=1e-8)
    found = np.array(gains_after(model, H, torque_noise, noise))
    assert (found[:, ~kept] == 0).all()
    corrected = at._replace(P=at.P - np.outer(at.gain, at.gain) * at.S)
    if kept.all():  # a mean over no time is none
        assert found[0] == pytest.approx(corrected.gain, rel=1e-4, abs=1e-7 * scale)
    at = corrected.later(corrected.P)
    for gain in found[1:]:
        at = at.later(at.P)
        assert gain[kept] == pytest.approx(at.gain[kept], rel=1e-4, abs=1e-7 * scale)
    poles = np.linalg.eigvals((np.eye(len(K)) - np.outer(K, at.C)) @ at.Ad)
    assert slowest_time_constant(model, K, H) == pytest.approx(-H / np.log(abs(poles).max()), rel=1e-9)


@pytest.mark.parametrize("name", ["speed", "angle", "mean speed"])
def test_innovations_are_white_and_of_variance_lambda_0(name: str, seed: int) -> None:
    """A plant with torque noise, filtered by the monitor with its theta pinned."""
    rng = np.random.default_rng(seed)
    model, torque_noise, N = axis_model(name), 0.3, 20_000
    noise = NOISE[model.drive.output] * (0.2 if name == "mean speed" else 1.0)
    K, lam0 = filter_gain(model, H, torque_noise, noise)
    rec = simulated(rng, model.drive, rng.standard_normal(N), torque_noise, noise)
    pinned = Settings.paper(H, K=tuple(K), lam0=lam0, P0=tuple(1e-60 * model.scale**2))
    _, trace = AxisMonitor(model, pinned).update_traced(SampleBlock(*rec))
    eps = trace.eps[1000:] / np.sqrt(lam0)
    assert np.mean(eps**2) == pytest.approx(1, abs=5 * np.sqrt(2 / N))
    for lag in (1, 2, 5):
        assert abs(np.mean(eps[lag:] * eps[:-lag])) < 5 / np.sqrt(N)


def test_without_torque_noise_the_speed_needs_no_gain() -> None:
    K, lam0 = filter_gain(reference_model(), H, 0.0, 2.0)
    assert pytest.approx(np.zeros(5), abs=1e-12) == K
    assert lam0 == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("torque_noise", "output_noise"),
    [(-1.0, 1.0), (np.nan, 1.0), (np.inf, 1.0), (1.0, 0.0), (1.0, -1.0), (1.0, np.nan)],
)
def test_noises_that_make_no_sense(torque_noise: float, output_noise: float) -> None:
    message = f"torque_noise = {torque_noise}, output_noise = {output_noise}: need"
    with pytest.raises(ValueError, match=message):
        filter_gain(reference_model(), H, torque_noise, output_noise)


def test_angle_without_torque_noise_has_no_filter() -> None:
    message = r"no stable Kalman filter for torque_noise = 0\.0 and output_noise = 0\.1"
    with pytest.raises(ValueError, match=message):
        filter_gain(reference_model("angle"), H, 0.0, 0.1)


def test_time_constants_of_the_predictor() -> None:
    speed, angle = reference_model(), reference_model("angle")
    assert slowest_time_constant(speed, np.zeros(5), H) == pytest.approx(0.55, abs=0.01)
    assert slowest_time_constant(angle, np.zeros(6), H) == np.inf
    K, _ = filter_gain(angle, H, 0.01, NOISE["angle"])
    assert slowest_time_constant(angle, K, H) == pytest.approx(0.22, abs=0.01)
    assert slowest_time_constant(angle, -K, H) == np.inf


# --- theta stays where its predictor is stable ------------------------------------------------------------------------


TRIPLES = (("kT", "1/Ja", "fm"), ("Jg", "Ja", "dg"), ("r", "kg", "da"), ("1/Jm", "ka", "fm"))


def gain_for(model: AxisModel, torque_noise: float) -> np.ndarray:
    if torque_noise == 0:
        return np.zeros(len(model.drive.states))
    return filter_gain(model, INTERVAL_S, torque_noise, NOISE[model.drive.output])[0]


def slowest_at(model: AxisModel, i: int, value: float, K: np.ndarray) -> float:
    theta = model.theta0.copy()
    theta[i] = value
    moved = replace(model, nominal=model.values(theta), bounds={})
    return slowest_time_constant(moved, K, INTERVAL_S)


@pytest.mark.parametrize(("output", "torque_noise"), [("speed", 0.0), ("speed", 0.1), ("angle", 0.1)])
@pytest.mark.parametrize("monitored", TRIPLES)
def test_bounds_end_where_the_predictor_is_stable(
    output: Output, monitored: tuple[str, ...], torque_noise: float
) -> None:
    """Judged by the time constants of the predictor, another way to the same poles."""
    model = AxisModel(three_mass(output), REFERENCE_VALUES, monitored)
    K = gain_for(model, torque_noise)
    limits = stable_limits(model, K, INTERVAL_S)
    for side, towards in ((0, -1), (1, 1)):
        for i, own in enumerate(model.limits[side]):
            at = float(limits[side, i])
            assert np.isfinite(slowest_at(model, i, at, K))
            if at != own:
                beyond = at + towards * 0.01 * model.scale[i]
                assert not np.isfinite(slowest_at(model, i, beyond, K))


def test_friction_cannot_drive(seed: int) -> None:
    """Without a gain_for the reference drive is stable for positive friction only."""
    model = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "1/Ja", "fm"))
    batch = AxisBatch([model], [Settings.paper(INTERVAL_S, P0=(1e-4, 1e-8, 1.0), settle_s=0.0)])
    assert batch.limits[0][2, 0] == pytest.approx(0.0, abs=1e-4)
    monitor = AxisMonitor.of_lane(batch, 0)
    monitor.update(SampleBlock(*experiment(seed, {"fm": -3.0}, samples=2000, fault_at=200)))
    fm = monitor.status().parameters[2]
    assert batch.state.theta[2, 0] >= batch.limits[0][2, 0]
    assert monitor.status().counters["projected"] > 0
    assert monitor.status().counters["diverged"] == 0
    assert np.isnan(fm.estimate) or fm.estimate < 0.5 * fm.nominal


def test_an_unstable_nominal_keeps_its_bounds() -> None:
    model = AxisModel(three_mass("speed"), {**REFERENCE_VALUES, "fm": -0.1}, ("kT", "1/Ja", "fm"))
    np.testing.assert_array_equal(stable_limits(model, np.zeros(5), INTERVAL_S), model.limits)
