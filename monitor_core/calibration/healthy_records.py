"""The recursion over healthy records: deviations of the estimates, and their scatter around the nominal values.

The size of the deviations is the recorded one, not that of P: it contains the colour of the innovations and model
errors. Its uncertainty comes from resampling blocks of several memories (block bootstrap; Kuensch 1989).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Bools, Floats, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.state import UNSEEN
from monitor_core.monitoring import AxisMonitor, NotTested
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings

OUT_OF_REACH = 1e30
"""alpha_2 of a test that never alarms."""


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
    """Samples before P(0) was found"""
    gated: int
    """Samples after that which a gate leaves out, or ``min_speed``"""
    confounded: tuple[str, ...]
    """What could not be distinguished at the end, in words"""
    uncertain: tuple[str, ...] = ()
    """Parameters that could not be determined within the memory, so that P(0) was not found"""


def without_tests(settings: Settings) -> Settings:
    """The settings with tests that never alarm and so never change the state."""
    return replace(settings, thresholds=(), alpha2=OUT_OF_REACH, covariance_reset=0.0, run_on=False)


def deviations(
    model: AxisModel,
    settings: Settings,
    records: Sequence[SampleBlock],
    progress: Callable[[float], None] = lambda _: None,
) -> list[RecordDeviations]:
    """Run all records one after the other, as the daemon would run an axis."""
    monitor = AxisMonitor(model, without_tests(settings))
    total, done, found = sum(len(record.t_us) for record in records), 0, []
    for record in records:
        found.append(_deviations(monitor, record, lambda part, at=done: progress((at + part) / total)))  # type: ignore[misc]
        done += len(record.t_us)
    return found


def _deviations(
    monitor: AxisMonitor, record: SampleBlock, progress: Callable[[int], None]
) -> RecordDeviations:
    model, lam0, st = monitor.model, monitor.settings.lam0, monitor.batch.state
    N, p, step = len(record.t_us), len(model.scale), monitor.settings.span
    d, s, tested = np.zeros((N, p)), np.ones((N, p)), np.zeros((N, p), np.bool_)
    seeding = gated = 0
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
        if seeds:
            seeding += part.size
        elif part.gate is not None:
            gated += int(np.count_nonzero(~part.gate))
        progress(min(k + step, N))
    status = monitor.status()
    uncertain = status.untested().get(NotTested.UNCERTAIN, ()) if st.seed_left[0] else ()
    return RecordDeviations(
        record.name, record.t_us, d, s, tested, seeding, gated, status.confounded, uncertain
    )


def first_tested(monitor: AxisMonitor, record: SampleBlock) -> int:
    """Run a record until the tests run; returns the number of samples that this takes, all where they never do."""
    st, step = monitor.batch.state, monitor.settings.span
    for k in range(0, len(record.t_us), step):
        monitor.update(record.select(slice(k, k + step)))
        if st.t[0] >= st.settled[0] and not st.seed_left[0]:
            return min(k + step, len(record.t_us))
    return len(record.t_us)


# --- Scatter of the estimates -----------------------------------------------------------------------------------------


BINS = 50
"""In a memory: of so many samples one is looked at."""
OFFSET = 0.3
"""Standard deviations: a mean that is farther off the nominal value would leave a test no threshold."""
_SMALL = 1e-12
_RESAMPLINGS = 1000
LONGEST, MOST_BLOCKS = 5, 30
"""Memories in a block, and how many blocks there are at least, where the record is long enough for both."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of p parameters in healthy records, in sizes of the parameters; times in samples.

    ``mean_d``, ``mean_s``, ``sigma``: of the deviation and of s = sqrt(lambda_0 P_ii).  ``power`` (B, p): draws of the
    true variance over sigma^2.  ``off`` (B, p): draws of the true mean less ``mean_d``.  Both are correlated between
    parameters whose estimates are.
    """

    mean_d: Floats  # (p,)
    mean_s: Floats  # (p,)
    sigma: Floats  # (p,)
    power: Floats  # (B, p)
    off: Floats  # (B, p)
    memories: float
    memory: float

    @property
    def offset(self) -> Floats:
        """Offset of the deviations (p,), as far as the rates include it."""
        most = OFFSET * self.sigma
        return np.clip(self.mean_d, -most, most)

    @property
    def beyond(self) -> Floats:
        """Lasting offset of the deviations (p,) that the rates do not include: covered by the allowance."""
        return np.abs(self.mean_d - self.offset)


def stride(memory: float) -> int:
    """Number of samples from one that is looked at to the next."""
    return max(1, round(memory / BINS))


def scatter(found: Sequence[RecordDeviations], memory: float, rng: np.random.Generator) -> Scatter:
    """Scatter of the records, with resamplings of their blocks.

    Raises:
        ValueError: the records have no tested samples.
    """
    parts = [part for record in found if len(part := binned(record, memory)) > BINS]
    if not parts:
        raise ValueError("no sample was tested")
    d, s = np.swapaxes(np.concatenate(parts), 0, 1)
    starts = np.cumsum([0] + [len(part) for part in parts])[:-1].tolist()
    memories = len(d) * stride(memory) / memory
    mean = d.mean(axis=0)
    around = d - mean
    length = max(1, round(BINS * min(LONGEST, memories / MOST_BLOCKS)))
    sums, count = _blocks(np.hstack([around, around**2]), starts, length)
    weights = rng.multinomial(len(count), np.full(len(count), 1 / len(count)), size=_RESAMPLINGS)
    means, squares = np.hsplit((weights @ sums) / (weights @ count)[:, np.newaxis], 2)
    variance = (around**2).mean(axis=0)
    power = _mirrored_variance(squares / variance, memories)
    chance = rng.multivariate_normal(np.zeros(d.shape[1]), _correlation(means), size=_RESAMPLINGS)
    variance *= 1 + 2 / memories  # the mean is of the same record
    off = np.sqrt(2 * variance / memories) * chance
    return Scatter(mean, s.mean(axis=0), np.sqrt(variance), power, off, memories, memory)


def looked_at(deviations: RecordDeviations, memory: float) -> Ints:
    """Indices of the samples that are looked at: of the tested ones, BINS in a memory."""
    q = stride(memory)
    return np.flatnonzero(deviations.tested.all(axis=1))[q - 1 :: q]


def binned(deviations: RecordDeviations, memory: float) -> Floats:
    """Deviation and s (n, 2, p) at these samples."""
    use = looked_at(deviations, memory)
    return np.stack([deviations.d[use], deviations.s[use]], axis=1)


def _correlation(values: Floats) -> Floats:
    """Correlation of the columns of values (B, p)."""
    z = (values - values.mean(axis=0)) / np.maximum(values.std(axis=0), _SMALL)
    return np.asarray(z.T @ z / len(z))


def _mirrored_variance(resampled: Floats, memories: float) -> Floats:
    """Draws of the true variance over that of the record, mirrored from the resampled ones (B, p).

    Few blocks scatter too little: at least as much as normal deviations that are forgotten within a memory.
    """
    log = np.log(resampled)
    return np.asarray(
        np.exp(-log * np.maximum(1.0, math.sqrt(2 / memories) / np.maximum(log.std(axis=0), _SMALL)))
    )


def _blocks(values: Floats, starts: Sequence[int], length: int) -> tuple[Floats, Floats]:
    """Sums (blocks, p) over blocks, within each record, and their lengths (blocks,)."""
    ends = [*starts[1:], len(values)]
    edges = [
        edge
        for start, end in zip(starts, ends, strict=True)
        for edge in range(start, max(start + 1, end - length // 2), length)
    ]
    return np.add.reduceat(values, edges, axis=0), np.diff([*edges, len(values)]).astype(float)
