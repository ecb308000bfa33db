"""Outliers: a few do no harm, many are no outliers; lambda_0 is told from both."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.kalman import filter_gain
from monitor_core.excitation.reference_experiment import FAULT_AT, NOISE, Experiment, experiment, experiments
from monitor_core.kernel.state import COUNTERS
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import settings_of, side_by_side, steady_p
from tests.core.laws import part
from tests.core.mismatch import NOMINAL, MismatchPlant, Watch
from tests.core.mismatch_monitor import FRICTION, INNOVATION_VARIANCE, watch
from tests.core.supervised import SUPERVISED

MODEL = reference_model("speed")
AXES = 48
SHARE = 0.002
WIDTH = 6.0
TORQUE_NOISE = 0.05
LARGEST = 0.8 * INNOVATION_VARIANCE**0.5
"""Of half an hour of the healthy axis of tests/core/mismatch.py."""


@pytest.fixture(scope="module")
def settings() -> Settings:
    return replace(settings_of("speed", 0, run_on=True), outlier_limit=WIDTH)


def healthy(seed: int) -> Experiment:
    return experiments(range(seed, seed + AXES))


def strike(values: Floats, sizes: tuple[float, float], rng: np.random.Generator) -> tuple[Floats, np.ndarray]:
    """The values with a few outliers of either sign, their sizes even in logarithm; and which they are."""
    hit = rng.random(values.shape) < SHARE
    size = np.exp(rng.uniform(np.log(sizes[0]), np.log(sizes[1]), values.shape)) * rng.choice([-1, 1], values.shape)
    return np.where(hit, values + size, values), hit


def spread(settings: Settings, samples: Experiment) -> tuple[AxisBatch, Floats]:
    """The batch at its end, and of each axis the root mean square of theta's relative deviations (p, AXES)."""
    batch, trace = side_by_side(MODEL, settings, samples)
    late = trace.theta[600::200] / MODEL.theta0[:, None] - 1
    return batch, np.asarray(np.sqrt((late**2).mean(axis=0)))


def counted(batch: AxisBatch) -> int:
    return int(batch.state.counts[COUNTERS.index("outlier")].sum())


def test_outliers_of_the_output_do_no_harm(settings: Settings, seed: int) -> None:
    clean = healthy(seed)
    y, hit = strike(clean.y, (20 * NOISE["speed"], 1e6), np.random.default_rng(seed))
    struck = clean._replace(y=y)
    _, expected = spread(settings, clean)
    batch, found = spread(settings, struck)
    _, unsifted = spread(replace(settings, outlier_limit=0.0), struck)
    assert counted(batch) == pytest.approx(hit[550:].sum(), rel=0.1)  # after settling
    ratio, without = (np.median(rms / expected, axis=1) for rms in (found, unsifted))
    assert (abs(ratio - 1) < 0.05).all(), ratio
    assert (without > 5).all(), without
    assert (found.max(axis=1) < 10 * expected.max(axis=1)).all(), "more in a row than are passed over"


@pytest.mark.parametrize("huge", [1e300, -1e300, 1e160, -1e30, 1e6])
def test_an_absurd_output_is_an_outlier_and_changes_no_estimate(huge: float, seed: int) -> None:
    """Watched as the daemon does by default."""
    gated = replace(SUPERVISED, outlier_limit=WIDTH)
    monitor = AxisMonitor(MODEL, replace(gated, P0=steady_p(MODEL, gated, range(10))))
    rec, st = experiment(seed), monitor.batch.state
    monitor.update(SampleBlock(*part(rec, 0, 1000)))
    kept = [field.copy() for field in (st.theta, st.P, st.g, st.lam0_running)]
    before = monitor.status().counters
    rec.y[1000] = huge
    monitor.update(SampleBlock(*part(rec, 1000, 1001)))
    assert {name: n - before[name] for name, n in monitor.status().counters.items() if n != before[name]} == {
        "outlier": 1
    }
    for old, new in zip(kept, (st.theta, st.P, st.g, st.lam0_running), strict=True):
        np.testing.assert_array_equal(old, new)
    assert abs(st.x).max() < 100
    monitor.update(SampleBlock(*part(rec, 1001)))
    assert (abs(st.theta[:, 0] / MODEL.theta0 - 1) < [0.3, 0.15, 0.9]).all()


def test_noise_alone_holds_no_outliers_and_lambda_0_is_true(settings: Settings, seed: int) -> None:
    """One in 5e8 is beyond six standard deviations; here are 1e5, so one run in five thousand sees one.

    48 axes, memories of 2000 samples, the last 1000 of them: six standard deviations of lambda_0 are 4 %.
    """
    batch, _ = spread(settings, healthy(seed))
    assert counted(batch) <= 1
    assert batch.state.lam0_running.mean() == pytest.approx(NOISE["speed"] ** 2, rel=0.06)


def test_what_healthy_records_show_is_no_outlier(settings: Settings, seed: int) -> None:
    """An axis that vibrates in parts of its motion: lambda_0 has the colour of that, the running variance has not."""
    K, lam0 = filter_gain(MODEL, 0.005, 2.0, NOISE["speed"])
    coloured = replace(settings, lam=0.98, settle_s=1.0, K=tuple(K), lam0=4 * lam0)
    clean, start = healthy(seed), 1000  # by then the running variance has come down
    y, hit = strike(clean.y, (7 * np.sqrt(lam0), 8 * np.sqrt(lam0)), np.random.default_rng(seed))
    batch, _ = side_by_side(MODEL, coloured, clean._replace(y=np.where(np.arange(len(y))[:, None] < start, clean.y, y)))
    assert batch.state.lam0_running.max() < 2 * lam0
    assert counted(batch) <= 2 < hit[start:].sum() / 10


def test_a_lasting_change_is_no_outlier(settings: Settings, seed: int) -> None:
    """Noise ten times as large after a quarter: hardly passed over, and lambda_0 follows."""
    clean = healthy(seed)
    K, lam0 = filter_gain(MODEL, 0.005, 2.0, NOISE["speed"])  # quick enough for so short a memory
    quiet = replace(settings, lam=0.98, settle_s=1.0, K=tuple(K), lam0=lam0)
    noise = 10 * NOISE["speed"] * np.random.default_rng(seed).standard_normal(clean.y.shape)
    noise[: len(noise) // 4] = 0.0
    batch, trace = side_by_side(MODEL, quiet, clean._replace(y=clean.y + noise))
    assert counted(batch) <= AXES * (3 + 0.02 * len(noise))
    assert batch.state.lam0_running.mean() == pytest.approx(np.nanmean(trace.eps[-1000:] ** 2), rel=0.25)
    assert batch.state.lam0_running.mean() > 20 * lam0


def test_a_fault_is_found_as_fast(settings: Settings, seed: int) -> None:
    """The samples that show a torque constant twice as large look like outliers."""
    record = experiments(range(seed, seed + AXES), {"kT": 2.0})
    first = []
    for s in (settings, replace(settings, outlier_limit=0.0)):
        batch, trace = side_by_side(MODEL, s, record)
        crossed = trace.g[FAULT_AT:, 0, 0] > batch.thresholds[0]
        assert crossed.any(axis=0).all()
        first.append(np.median(crossed.argmax(axis=0)))
    assert first[0] < 1.3 * first[1]


@pytest.mark.parametrize("outside", ["brake", "collision"])
def test_a_jolt_is_no_change_of_the_axis(outside: str, seed: int) -> None:
    """A torque of 2 to 8 N m that nobody measures, or Coulomb friction ten times as large, for up to half a second.

    Without ``largest_error`` one in five raises an alarm of kT, fc or fm.
    """
    rng = np.random.default_rng(seed)
    plant, monitor = MismatchPlant(NOMINAL, rng), watch(FRICTION)
    plain = replace(monitor.settings, largest_error=LARGEST)
    monitor = Watch(monitor.model, plain, monitor.conditions)
    monitor.take(plant.take(300.0))
    for k in range(8):
        raised, _ = monitor.take(plant.take(round(rng.uniform(40.0, 60.0))))
        assert not raised, k
        before = monitor.monitor.status().counters["outlier"]
        push = rng.choice([-1, 1]) * rng.uniform(4.0, 8.0)
        jolt = {"fc": 10.0} if outside == "brake" else {}
        block = plant.take(round(rng.uniform(0.1, 0.5), 2), jolt, push=0.0 if jolt else push)
        raised = [*monitor.take(block)[0], *monitor.take(plant.take(20.0))[0]]
        assert not raised, (k, raised)
        print(k, monitor.monitor.status().counters["outlier"] - before)
