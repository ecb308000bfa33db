"""The recursion over healthy records: deviations of the estimates, and their standard deviations from P."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.state import UNSEEN
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings

Times = NDArray[np.int64]
Bools = NDArray[np.bool_]

OUT_OF_REACH = 1e30
"""alpha_2 of a test that never alarms."""


@dataclass(frozen=True)
class Deviations:
    """Deviations of the estimates in one record and sqrt(lambda_0 P_ii), in sizes of the parameters.

    ``tested`` marks the samples at which the tests of a parameter ran.
    """

    name: str
    t_us: Times  # (N,)
    d: Floats  # (N, p)
    s: Floats  # (N, p)
    tested: Bools  # (N, p)
    seeding: int
    """Samples before P(0) was found"""
    confounded: tuple[str, ...]
    """What could not be told apart at the end, in words"""


def without_tests(settings: Settings) -> Settings:
    """The settings with tests that never alarm and so never change the state."""
    return replace(settings, thresholds=(), alpha2=OUT_OF_REACH, covariance_reset=0.0, run_on=False)


def deviations(
    model: AxisModel,
    settings: Settings,
    records: Sequence[SampleBlock],
    progress: Callable[[float], None] = lambda _: None,
) -> list[Deviations]:
    """Run all records one after the other, as the daemon would run an axis."""
    monitor = AxisMonitor(model, without_tests(settings))
    total, done, found = sum(len(record.t_us) for record in records), 0, []
    for record in records:
        found.append(_deviations(monitor, record, lambda part, at=done: progress((at + part) / total)))  # type: ignore[misc]
        done += len(record.t_us)
    return found


def _deviations(monitor: AxisMonitor, record: SampleBlock, progress: Callable[[int], None]) -> Deviations:
    model, lam0, st = monitor.model, monitor.settings.lam0, monitor.batch.state
    N, p, step = len(record.t_us), len(model.scale), monitor.settings.span
    d, s, tested, seeding = np.zeros((N, p)), np.ones((N, p)), np.zeros((N, p), np.bool_), 0
    # In pieces as short as the spans after which parameters are classified as observed.
    for k in range(0, N, step):
        part = record.select(slice(k, k + step))
        before, seeds = st.shift[:, 0].copy(), bool(st.seed_left[0])
        _, trace = monitor.update_traced(part)
        moved = forward_fill(part.shift, before) if part.shift is not None else before
        rows = slice(k, k + step)
        d[rows] = (trace.theta - model.theta0 - moved) / model.scale
        s[rows] = np.sqrt(lam0 * trace.P) / model.scale
        learned = np.isfinite(trace.eps)[:, np.newaxis] & (st.observed[:, 0] != UNSEEN)
        tested[rows] = learned & (not seeds)
        seeding += len(part.t_us) if seeds else 0
        progress(min(k + step, N))
    return Deviations(record.name, record.t_us, d, s, tested, seeding, monitor.status().confounded)
