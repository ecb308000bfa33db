"""Runs the recursion over healthy records: deviations of the estimates from the nominal values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.kernel.state import UNSEEN
from monitor_core.monitoring import AxisMonitor, NotTested
from monitor_core.samples import SampleBlock, forward_fill


@dataclass(frozen=True)
class RecordDeviations:
    """Deviations of the estimates in one record and sqrt(lambda_0 P_ii), in sizes of the parameters.

    ``tested`` marks the samples at which the tests of a parameter ran.
    """

    name: str
    t_us: Ints  # (N,)
    d: Floats  # (N, p)
    s: Floats  # (N, p)
    tested: Bools  # (N, p)
    seeding: int
    """Number of samples before P(0) was found"""
    gated: int
    """Number of later samples that are excluded by a gate or ``min_speed``"""
    confounded: tuple[str, ...]
    """Sentences on parameters that could not be distinguished at the end"""
    uncertain: tuple[str, ...] = ()
    """Parameters that could not be determined within the memory, so that P(0) was not found"""


_MOST_OF_RECORD = 0.25
"""Largest share of the longest record that changes may take to be found, if most of it is standstill"""


def deviations(
    axis: MonitoredAxis, records: Sequence[SampleBlock], progress: Callable[[float], None] = lambda _: None
) -> list[RecordDeviations]:
    """Run all records one after the other through one monitor, as the daemon would; returns their deviations."""
    monitor = AxisMonitor(*axis.without_tests)
    total, done, results = sum(len(record.t_us) for record in records), 0, []
    for record in records:
        results.append(_deviations(monitor, record, lambda part, at=done: progress((at + part) / total)))  # type: ignore[misc]
        done += len(record.t_us)
    return results


def _deviations(monitor: AxisMonitor, record: SampleBlock, progress: Callable[[int], None]) -> RecordDeviations:
    model, lam0, st = monitor.model, monitor.settings.lam0, monitor.batch.state
    N, p, step = len(record.t_us), len(model.scale), monitor.settings.span
    d, s, tested = np.zeros((N, p)), np.ones((N, p)), np.zeros((N, p), np.bool_)
    seeding = gated = 0
    # In pieces no longer than a span, after which parameters are classified as observed or not.
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
        if seeds:
            seeding += part.size
        elif part.gate is not None:
            gated += int(np.count_nonzero(~part.gate))
        progress(min(k + step, N))
    status = monitor.status()
    uncertain = status.untested().get(NotTested.UNCERTAIN, ()) if st.seed_left[0] else ()
    return RecordDeviations(record.name, record.t_us, d, s, tested, seeding, gated, status.confounded, uncertain)


def time_with_standstill(tests_s: float, found: Sequence[RecordDeviations], interval_s: float) -> float:
    """The time that contains so much time of tests [s] where gates and ``min_speed`` exclude samples; two digits.

    At most a quarter of the longest record, so that there are several such times in it; no less than ``tests_s``.
    """
    after = sum(len(deviations.t_us) - deviations.seeding for deviations in found)
    gated = sum(deviations.gated for deviations in found)
    if not gated:
        return tests_s
    most_s = _MOST_OF_RECORD * interval_s * max(len(deviations.t_us) for deviations in found)
    return max(float(f"{min(tests_s * after / max(after - gated, 1), most_s):.2g}"), tests_s)


def first_tested(monitor: AxisMonitor, record: SampleBlock) -> int:
    """Run a record until the tests start; returns the number of samples until then (all, if they never start)."""
    st, step = monitor.batch.state, monitor.settings.span
    for k in range(0, len(record.t_us), step):
        monitor.update(record.select(slice(k, k + step)))
        if st.t[0] >= st.settled[0] and not st.seed_left[0]:
            return min(k + step, len(record.t_us))
    return len(record.t_us)
