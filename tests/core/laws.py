"""What laws of the engine are tested with: lively axes in every way to watch them, and all bits of a state."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.excitation.reference_experiment import NOISE, Experiment
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.cases import CASES, Case, record

SAMPLES = 150
Way = Mapping[str, float | bool]
WAYS: tuple[Way, ...] = (
    {"information_floor": 0.05, "min_excitation": 0.05},
    {"information_floor": 0.3},
    {"min_excitation": 0.3},
    {"joint_state": True},
    {"outlier_limit": 3.0},
    {"covariance_reset": 20.0},
    {
        "information_floor": 0.05,
        "min_excitation": 0.05,
        "joint_state": True,
        "outlier_limit": 4.0,
        "covariance_reset": 5.0,
    },
    {"information_floor": 0.1, "min_excitation": 0.05, "joint_state": True},
)
seeds = st.integers(0, 2**32 - 1)
cases = st.sampled_from(CASES)
ways = st.sampled_from(({}, *WAYS))
law = settings(deadline=None, max_examples=25)  # forty times as many in `make soak`


def lively(case: Case, way: Way | None = None) -> Settings:
    """Large steps, low thresholds: much happens in few samples."""
    s = case.settings(relative_sd=0.05, lam=0.97, alpha1=0.2, alpha2=0.2, settle_s=0.1)
    return replace(s, **(way or {}))  # type: ignore[arg-type]


def with_pause(seed: int, case: Case, samples: int = SAMPLES) -> Experiment:
    """With lost samples, outliers, and without torque in its second half."""
    rec = record(seed, case, samples, jitter=0.3, gaps=1)
    rng = np.random.default_rng(seed)
    rec.u[samples // 2 :] = 0.0
    rec.y[rng.choice(samples, 3, replace=False)] += 30 * NOISE[case.output]
    return rec


def shifts(seed: int, case: Case, size: float = 0.02, samples: int = SAMPLES) -> Floats:
    """(samples, p), a smooth way of this size beside the parameters'."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(case.model.theta0))
    t = np.linspace(0, 3, samples)[:, None]
    return np.asarray(size * case.model.scale * (np.sin(t + phase) - np.sin(phase)))


def conditioned(seed: int, case: Case, rec: Experiment) -> SampleBlock:
    """For some seeds with conditions that move, are unknown at times, forbid to learn."""
    rng, N = np.random.default_rng(seed), len(rec.u)
    shift = shifts(seed, case, samples=N) if rng.integers(2) else None
    if shift is not None:
        shift[rng.random(N) < 0.1] = np.nan
    return SampleBlock(*rec, shift, rng.random(N) < 0.9 if rng.integers(2) else None)


def part(rec: Experiment, start: int, stop: int | None = None) -> Experiment:
    return Experiment(rec.t_us[start:stop], rec.u[start:stop], rec.y[start:stop])


def restored(monitor: AxisMonitor) -> AxisMonitor:
    """Another one that goes on from what was saved."""
    other = AxisMonitor(monitor.model, monitor.settings)
    other.from_arrays({name: array.copy() for name, array in monitor.to_arrays().items()})
    return other


def state(monitor: AxisMonitor) -> tuple[bytes, bytes]:
    """All bits but the sign of a zero, which a sum with zero forgets."""
    floats, ints = monitor.batch.column(monitor.lane)
    return (floats + 0.0).tobytes(), ints.tobytes()


def fates(monitor: AxisMonitor) -> dict[str, int]:
    """What became of its samples, as far as there are any."""
    return {name: n for name, n in monitor.status().counters.items() if n}
