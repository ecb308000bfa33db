"""Statistics of healthy records: from deviations to the tails of the CUSUM sums, without thresholds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats
from monitor_core.calibration.copy_excursions import SAMPLES, simulate_excursions
from monitor_core.calibration.false_alarm_tail import Tail, tails
from monitor_core.calibration.healthy_records import RecordDeviations
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.scatter import BINS, Scatter, binned, scatter
from monitor_core.calibration.shrinkage import shrink
from monitor_core.samples import SampleBlock
from monitor_core.settings import ALLOWED


@dataclass(frozen=True)
class HealthyStatistics:
    """Of p parameters: scatter of the estimates, allowance of the tests, and tails of the sums."""

    scatter: Scatter
    alone: Scatter
    """The same scatter with the uncertainty that the records alone leave, without the knowledge of the copies"""
    allowance: Floats  # (p,), in sizes
    tails: tuple[Tail, ...]


def healthy_statistics(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    found: Sequence[RecordDeviations],
    k: float,
    rng: np.random.Generator,
    copies: int = SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> HealthyStatistics:
    """Statistics from which thresholds are computed.

    ``found`` are the deviations of the records; ``k`` is nu over sigma (``nu_over_sigma``); ``copies``: samples of
    bootstrap copies.

    Raises:
        ValueError: no parameter was tested, or nothing was learned, in any record.
    """
    excursions = simulate_excursions(axis, records, k, rng, copies, progress)
    seen = scatter(found, axis.settings.memory, rng)
    shrunk = shrink(seen, excursions, rng)
    alone = replace(shrunk, off=seen.off, power=seen.power)
    return HealthyStatistics(shrunk, alone, allowance(found, shrunk), tails(shrunk, excursions))


SHORTEST, MOST = 20, 10
"""Least number of memories in a part of a record, and largest number of parts."""
LEVEL = 0.99
"""Confidence with which the parts must differ by more than chance."""


def allowance(found: Sequence[RecordDeviations], scatter: Scatter) -> Floats:
    """Allowance of each parameter (p,), in sizes.

    The means of parts of all records scatter by sigma sqrt(2 / memories) if there is only noise.  What exceeds that
    (DerSimonian and Laird 1986; nothing where chance explains it) is a bias that comes and goes, with the pose or the
    temperature.  The lasting bias, of nominal values that are not quite those of the axis, is added.
    """
    means, weights = [], []
    for record in found:
        d = binned(record, scatter.memory)[:, 0]
        count = int(np.clip(len(d) // (SHORTEST * BINS), 1, MOST))
        for part in np.array_split(d, count) if len(d) else ():
            means.append(part.mean(axis=0))
            weights.append(len(part) / BINS / 2)
    m, w = np.array(means), np.array(weights)[:, np.newaxis]
    if len(m) < 2:
        return scatter.beyond
    # The scatter within the parts, as that between them is what is tested.
    inside = np.sqrt(np.maximum(scatter.sigma**2 - m.var(axis=0), 0.1 * scatter.sigma**2))
    w = w / inside**2
    mean = (w * m).sum(axis=0) / w.sum(axis=0)
    Q, freedom = (w * (m - mean) ** 2).sum(axis=0), len(m) - 1
    excess = (Q - freedom) / (w.sum(axis=0) - (w**2).sum(axis=0) / w.sum(axis=0))
    real = 2 * gammaincinv(freedom / 2, LEVEL ** (1 / len(Q))) < Q
    return np.asarray(scatter.beyond + np.where(real, ALLOWED * np.sqrt(np.maximum(excess, 0.0)), 0.0))
