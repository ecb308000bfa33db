"""P bounded, theta kept where nothing is learned, and each parameter knows whether it is observed."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, TORQUE_RMS, Experiment, faulty
from monitor_core.kernel.block import Trace
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor, Observation, Status
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import side_by_side, steady_p
from tests.core.laws import part
from tests.core.simulated import changing_output
from tests.core.supervised import FLOOR, MODEL, SUPERVISED, TORQUE_NOISE, H, lively_then_still, moved
from tests.shares import soaked


@pytest.fixture(scope="module")
def settings() -> Settings:
    return replace(SUPERVISED, P0=steady_p(MODEL, SUPERVISED, range(20)))


PAUSES = ("still", "constant speed", "a sine", "hardly moving")
LIVELY, PAUSE, AGAIN, FAULT = 2000, 12_000, 2600, 600
"""Samples: lively, the pause, lively again with a fault after some."""
AXES = 32


def torque_of(kind: str, rng: np.random.Generator) -> Floats:
    t = np.arange(PAUSE) * H
    if kind == "a sine":
        return np.asarray(1.5 * np.sin(2 * np.pi * rng.uniform(0.5, 3) * t + rng.uniform(0, 6)))
    if kind == "hardly moving":
        return 0.03 * multisine(rng, PAUSE, H, BAND_HZ, TORQUE_RMS)
    return np.full(PAUSE, 0.0 if kind == "still" else rng.uniform(0.1, 1.0))


def through_a_pause(
    kind: str | None, seed: int, seeds: int, settings: Settings, fault: dict[str, float]
) -> tuple[Trace, int]:
    """Reference drives, one for each seed; the fault comes at the returned sample."""
    rngs = [np.random.default_rng((seed, k)) for k in range(seeds)]
    first, last = ([multisine(r, n, H, BAND_HZ, TORQUE_RMS) for r in rngs] for n in (LIVELY, AGAIN))
    pause = [torque_of(kind, r) if kind else np.zeros(0) for r in rngs]
    u = np.stack([np.concatenate(parts) for parts in zip(first, pause, last, strict=True)], axis=1)
    at = len(u) - AGAIN + FAULT
    acting = u + TORQUE_NOISE * np.stack([r.standard_normal(len(u)) for r in rngs], axis=1)
    parts = ((REFERENCE_VALUES, acting[:at]), (faulty(REFERENCE_VALUES, fault), acting[at:]))
    y = changing_output(three_mass("speed"), parts)
    noise = np.stack([r.standard_normal(len(u)) for r in rngs], axis=1)
    rec = Experiment(np.arange(len(u), dtype=np.int64) * round(H * 1e6), u, y + noise)
    return side_by_side(MODEL, settings, rec)[1], at


def delay(trace: Trace, at: int, settings: Settings) -> float:
    """Median seconds to the first alarm of kT; none after the fault counts as all the time there was."""
    over = (trace.g[at:, :, 0] > settings.alpha2 * MODEL.scale[0]).any(axis=1)
    return float(np.median(np.where(over.any(axis=0), over.argmax(axis=0), len(over)))) * H


@pytest.fixture(scope="module")
def without_a_pause(settings: Settings, seed: int) -> float:
    run_on = replace(settings, run_on=True)
    return delay(*through_a_pause(None, seed, AXES, run_on, {"kT": 1.2}), run_on)


@pytest.mark.parametrize("kind", soaked(PAUSES, "still", "constant speed"))
def test_a_pause_raises_nothing_and_the_first_fault_after_it_is_found_as_fast(
    kind: str, settings: Settings, without_a_pause: float, seed: int
) -> None:
    run_on = replace(settings, run_on=True)
    trace, at = through_a_pause(kind, seed, AXES, run_on, {"kT": 1.2})
    assert bounded(trace, settings)
    assert alarms_before(trace, at, settings) <= 1  # of 32; of 2400 that were counted one, in a sine
    assert delay(trace, at, run_on) < 1.2 * without_a_pause


def bounded(trace: Trace, settings: Settings) -> bool:
    """P by its bound, theta by what would still be a drive or by six of the largest standard deviations."""
    most = np.array(settings.P0)[:, np.newaxis] / FLOOR
    sd = np.sqrt(settings.lam0 * most / (1 + settings.lam)) / MODEL.theta0[:, np.newaxis]
    away = abs(trace.theta / MODEL.theta0[:, np.newaxis] - 1)
    return bool((most >= trace.P).all() and (away < np.maximum(2.0, 6 * sd)).all())


def alarms_before(trace: Trace, at: int, settings: Settings) -> int:
    """Axes with an alarm before sample ``at``."""
    return int((trace.g[:at] > (settings.alpha2 * MODEL.scale)[:, np.newaxis]).any(axis=(0, 1, 2)).sum())


@pytest.mark.parametrize("floor", [0.0, FLOOR])
def test_an_axis_at_rest_keeps_every_bit_and_after_it_all_is_watched_again(
    floor: float, settings: Settings, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    monitor = AxisMonitor(MODEL, replace(settings, K=(), K_after=(), information_floor=floor))
    rec = moved("speed", lively_then_still(rng, 1000, 4000, 600), rng)
    monitor.update(SampleBlock(*part(rec, 0, 3500)))
    st = monitor.batch.state
    kept = [field.copy() for field in (st.theta, st.P, st.g)]
    before = monitor.status().counters["starved"]
    monitor.update(SampleBlock(*part(rec, 3500, 5000)))
    for old, new in zip(kept, (st.theta, st.P, st.g), strict=True):
        np.testing.assert_array_equal(old, new)
    assert monitor.status().counters["starved"] - before == 1500
    assert {p.observation for p in monitor.status().parameters} == {Observation.UNSEEN}
    monitor.update(SampleBlock(*part(rec, 5000)))
    assert {p.observation for p in monitor.status().parameters} == {Observation.OBSERVED}
    assert (st.theta != kept[0]).all()


def test_a_constant_speed_shows_friction_only(settings: Settings, seed: int) -> None:
    """Torque and friction balance: 1/Ja plays no part, kT and fm only as a ratio.

    What is not observed shows its last observed value, and raises no alarm.
    """
    rng = np.random.default_rng(seed)
    monitor = AxisMonitor(MODEL, settings)
    u = np.concatenate([multisine(rng, LIVELY, H, BAND_HZ, TORQUE_RMS), np.full(4000, 0.5)])
    rec = moved("speed", u, rng)
    monitor.update(SampleBlock(*part(rec, 0, LIVELY)))
    assert all(p.observation is Observation.OBSERVED for p in monitor.status().parameters)
    assert monitor.status().confounded == ()
    monitor.update(SampleBlock(*part(rec, LIVELY)))
    assert {p.observation for p in monitor.status().parameters} == {Observation.UNSEEN}
    assert "kT and fm cannot be distinguished" in monitor.status().confounded
    i = MODEL.monitored.index("1/Ja")
    shown, g = monitor.status().parameters[i].estimate, monitor.batch.state.g.copy()
    monitor.batch.state.theta[i] *= 2  # as far off as can be
    monitor.update(SampleBlock(rec.t_us[-1] + 5000 * np.arange(1, 401), u[-400:], rec.y[-400:]))
    assert monitor.status().parameters[i].estimate == shown
    assert (monitor.batch.state.g[:, i] == g[:, i]).all()


def test_P_stays_bounded_symmetric_and_definite_whatever_comes(seed: int) -> None:
    """Noise, silence, steps and spikes; the floor alone must hold."""
    rng = np.random.default_rng(seed)
    s = replace(SUPERVISED, lam=0.98, min_excitation=0.0, settle_s=0.0, P0=tuple((0.01 * MODEL.scale) ** 2))
    monitor = AxisMonitor(MODEL, s)
    t = 0
    for _ in range(40):
        n = int(rng.integers(50, 1000))
        size = 10 ** rng.uniform(-6, 3, 2) * (rng.random(2) < 0.7)
        u, y = size[0] * rng.standard_normal(n), size[1] * rng.standard_normal(n)
        monitor.update(SampleBlock(t + 5000 * np.arange(1, n + 1), u + rng.choice([0, 1.0]), y))
        t += 5000 * n
        P = monitor.batch.state.P[:, :, 0] / np.sqrt(np.outer(s.P0, s.P0))
        assert (P == P.T).all()
        assert np.linalg.eigvalsh(P).min() > 0
        assert np.diag(P).max() <= 1 / FLOOR * (1 + 1e-9)


@pytest.mark.parametrize(("noise", "known"), [(0.0, False), (1.0, False), (0.0, True)])
def test_an_axis_that_stands_still_at_first_learns_nothing(
    noise: float, known: bool, settings: Settings, seed: int
) -> None:
    """A daemon starts before its robot moves: noise alone says nothing of the parameters, and must not seem to.

    And then it moves as if nothing had been; a saved state goes on as well.
    """
    rng = np.random.default_rng(seed)
    monitor = AxisMonitor(MODEL, settings if known else replace(settings, P0=()))
    t, zero = np.arange(12_000, dtype=np.int64) * 5000, np.zeros(12_000)
    assert monitor.update(SampleBlock(t, zero, noise * rng.standard_normal(12_000))) == []
    status = monitor.status()
    assert known or {p.status for p in status.parameters} == {Status.SEEDING}
    assert noise or status.counters["starved"] > 0.8 * 12_000
    assert noise or {p.observation for p in status.parameters} == {Observation.UNSEEN}
    np.testing.assert_array_equal(monitor.batch.state.theta[:, 0], MODEL.theta0)
    saved = AxisMonitor(MODEL, monitor.settings)
    saved.from_arrays(monitor.to_arrays())
    rec = moved("speed", multisine(rng, 8000, H, BAND_HZ, TORQUE_RMS), rng)
    later = SampleBlock(rec.t_us + t[-1] + 5000, rec.u, rec.y)
    assert monitor.update(later) == saved.update(later) == []
    assert {p.status for p in monitor.status().parameters} <= {Status.TRACKING, Status.WEAK}
    assert (abs(monitor.batch.state.theta[:, 0] / MODEL.theta0 - 1) < [0.3, 0.15, 0.9]).all()
    P0 = np.array(settings.P0)
    assert (abs(np.log(monitor.batch.state.P_nom[:, 0] / P0)) < np.log(3)).all()
