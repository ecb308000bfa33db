"""Surrogate records ("copies"): the motion of a healthy record, with resampled innovations.

This is a residual bootstrap (Kreiss and Lahiri 2012) that keeps the autocorrelation of the innovations.  The recursion
itself runs over the copies, so the autocorrelation and the asymmetry of the estimates are reproduced.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.healthy_records import first_tested
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.simulated_copies import Plants, innovations
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings

LANES = 64
CHUNK = 4000
BLOCK = 1.0
"""Length of a block of innovations in memories.  Longer blocks repeat chance patterns, shorter ones lose
autocorrelation."""
LEAST_PARTS = 8
"""Least number of chunks of a record."""


@dataclass(frozen=True)
class CopySource:
    """Data of a record from which copies are made; they start where the tests start."""

    u: Floats
    eps: Floats
    x: Floats
    u_before: float
    column: tuple[Floats, np.ndarray]
    t_us: int
    weight: Floats | None = None


def copy_source(axis: MonitoredAxis, record: SampleBlock) -> CopySource | None:
    """Source for copies of a record; None if too few of its samples were used.

    Samples that a gate or ``min_speed`` excludes from the tests are left out.
    """
    monitor = AxisMonitor(*axis.without_tests)
    start = first_tested(monitor, record)
    predicted = innovations(axis, record, (start,))
    eps = predicted.eps[start:]
    eps = eps[np.isfinite(eps)]
    if len(eps) < 2 * axis.settings.memory:
        return None
    column, t_us = monitor.batch.column(0), int(monitor.batch.state.t[0])
    tested = np.arange(start, record.size)
    if record.gate is not None:
        tested = tested[record.gate[start:]]
    weight = None
    if record.weight is not None:  # the last known weight at each sample; 0 before the first
        weight = forward_fill(record.weight[:, np.newaxis], np.zeros(1))[tested, 0]
    return CopySource(
        record.u[tested], eps - eps.mean(), predicted.x[0], float(record.u[start - 1]), column, t_us, weight
    )


def block_length(settings: Settings) -> int:
    """Number of samples in a block of innovations."""
    return max(2, round(BLOCK * settings.memory))


def bootstrap_copies(
    axis: MonitoredAxis, source: CopySource, draw: Callable[[int], Floats]
) -> Iterator[tuple[np.ndarray, Floats, Floats, Floats | None]]:
    """LANES copies of a record in chunks, at equal intervals: t_us (N,), u and y (N, LANES), weight (N,).

    ``draw`` gives the next innovations (count, LANES).
    """
    plants = Plants(axis, [axis.model.nominal])
    which = np.zeros(LANES, np.int64)
    # Start one sample earlier, as its torque acts until the first sample.
    before = np.full((1, LANES), source.u_before)
    start = np.repeat(source.x[np.newaxis], LANES, axis=0)
    _, x = plants.run(which, start, before[0], before, np.zeros((1, LANES)))
    step, N = round(axis.settings.interval_s * 1e6), len(source.u)
    chunk = min(CHUNK, N // LEAST_PARTS + 1)
    for k in range(0, N, chunk):
        u = np.repeat(source.u[k : k + chunk, np.newaxis], LANES, axis=1)
        weight = None if source.weight is None else source.weight[k : k + chunk]
        held = None if weight is None else np.repeat(weight[:, np.newaxis], LANES, axis=1)
        y, x = plants.run(which, x, before[0], u, draw(len(u)), held)
        before = u[-1:]
        t_us = source.t_us + step * np.arange(k + 1, k + 1 + len(u), dtype=np.int64)
        yield t_us, u, y, weight
