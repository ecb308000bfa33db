"""Surrogate records: the motion of a healthy record, its innovations in another order, run through the monitor.

Residual bootstrap (Kreiss and Lahiri 2012) in blocks of the innovations, which keeps their colour.  The recursion
itself runs over the copies, so the autocorrelation and the asymmetry of the estimates are reproduced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.healthy_records import first_tested, stride, without_tests
from monitor_core.calibration.simulated_copies import Plants, innovations
from monitor_core.calibration.synthetic_innovations import MatchedBlocks
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.excursions import excursions
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock, forward_fill
from monitor_core.settings import Settings

SAMPLES, OWN_SAMPLES = 32_000_000, 4_000_000
"""That are simulated, for the tests' sums, and of them at most for what copies are off by."""
LANES = 64
CHUNK = 4000
BLOCK = 1.0
"""Memories in a block of innovations: in longer ones what these have by chance stays, in shorter ones less colour."""
MANY, FEW, FEWEST = 8.0, 0.125, 8
"""Blocks that a copy has, over those of the record: so that all copies are alike, and so that they differ; at least so
many."""
LEAST_PARTS = 8
"""Of a record."""
SETTLED = 3
"""Memories until the deviations have forgotten their start."""
LEAST = 0.5
"""Excursions above that are kept, in sigma times memory."""
_ROOM, _KNOWN = 300_000, 50


@dataclass(frozen=True)
class Excursions:
    """Peaks of the sums of the tests in each excursion from zero, falling; [direction][parameter].

    In sizes times samples, of tests with nu over sigma = k (p,), in ``samples`` of each test.
    """

    k: Floats
    sigma: Floats
    mean: Floats
    """Of the deviation, in sizes (p,)"""
    error: Floats
    """Covariance (2 p, 2 p) of what the means, over sigma, and log sigma are off by themselves (``own_error``)"""
    largest: tuple[tuple[Floats, ...], ...]
    samples: float


def simulate_excursions(
    model: AxisModel,
    settings: Settings,
    records: Sequence[SampleBlock],
    k: float,
    rng: np.random.Generator,
    samples: int = SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> Excursions:
    """Excursions of the sums of tests with nu = k sigma, in ``samples`` of copies.

    Raises:
        ValueError: no record has innovations, or is long enough.
    """
    sources = [source for record in records if (source := copy_source(model, settings, record)) is not None]
    if not sources:
        raise ValueError("nothing was learned from any record")
    copies = _Copies(model, settings)
    total = sum(len(source.u) for source in sources)
    # sigma comes from the first memories; short records are run once more for it.
    least = 1 if total > 4 * _KNOWN * settings.memory else 2
    turns = max(least, round(samples / total / LANES))
    error = _bootstrap_error(copies, sources, rng, min(OWN_SAMPLES, samples))
    watch = _PeakCounter(model, settings, k)
    progress(1 / (turns + 1))
    for turn in range(turns):
        for source in sources:
            watch.begin()
            for d, s in copies.run(source, bootstrap_blocks(settings, source, MANY, rng)):
                watch.take(d, s)
        progress((turn + 2) / (turns + 1))
    return watch.found(error)


def _bootstrap_error(
    copies: _Copies, sources: Sequence[CopySource], rng: np.random.Generator, samples: int
) -> Floats:
    """Error covariance (2 p, 2 p) of the copies, scaled from copies with few of the innovations to all of them."""
    few = [bootstrap_blocks(copies.settings, source, FEW, rng) for source in sources]
    parts: list[PartSums] = []
    turns = math.ceil(samples / LANES / sum(len(source.u) for source in sources))
    for _ in range(turns):
        for source, blocks in zip(sources, few, strict=True):
            for d, _ in copies.run(source, blocks):
                parts.append(part_sums(d))
        if not parts:
            raise ValueError(f"no record is longer than {SETTLED} memories")
    share = sum(blocks.samples for blocks in few) / sum(len(source.eps) for source in sources)
    return own_error(parts) * share


@dataclass(frozen=True)
class CopySource:
    """What copies of a record are made from, starting where the estimates run."""

    u: Floats
    eps: Floats
    x: Floats
    u_before: float
    column: tuple[Floats, np.ndarray]
    t_us: int
    weight: Floats | None = None


def copy_source(model: AxisModel, settings: Settings, record: SampleBlock) -> CopySource | None:
    """What copies of a record are made from; None where too little was learned in it.

    What a gate or ``min_speed`` leaves out of the tests is left out of the copies.
    """
    monitor = AxisMonitor(model, without_tests(settings))
    start = first_tested(monitor, record)
    found = innovations(model, settings, record, (start,))
    eps = found.eps[start:]
    eps = eps[np.isfinite(eps)]
    if len(eps) < 2 * settings.memory:
        return None
    column, t_us = monitor.batch.column(0), int(monitor.batch.state.t[0])
    tested = np.arange(start, record.size)
    if record.gate is not None:
        tested = tested[record.gate[start:]]
    weight = None
    if record.weight is not None:  # the last known one at each sample; 0 before there is one
        weight = forward_fill(record.weight[:, np.newaxis], np.zeros(1))[tested, 0]
    return CopySource(
        record.u[tested], eps - eps.mean(), found.x[0], float(record.u[start - 1]), column, t_us, weight
    )


def block_length(settings: Settings) -> int:
    """Samples of a block of innovations."""
    return max(2, round(BLOCK * settings.memory))


def bootstrap_blocks(
    settings: Settings, source: CopySource, share: float, rng: np.random.Generator
) -> MatchedBlocks:
    """Innovations for LANES copies of a record, each drawn from a share of those of the record."""
    length = block_length(settings)
    return MatchedBlocks(source.eps, length, max(FEWEST, round(share * len(source.eps) / length)), LANES, rng)


def bootstrap_copies(
    model: AxisModel, settings: Settings, source: CopySource, draw: Callable[[int], Floats]
) -> Iterator[tuple[np.ndarray, Floats, Floats, Floats | None]]:
    """LANES copies of a record in chunks, at equal intervals: t_us (N,), u and y (N, LANES), weight (N,).

    ``draw`` gives the next innovations (count, LANES).
    """
    plants = Plants(model, settings, [model.nominal])
    which = np.zeros(LANES, np.int64)
    # From the sample before, whose torque acts until the first one.
    before = np.full((1, LANES), source.u_before)
    start = np.repeat(source.x[np.newaxis], LANES, axis=0)
    _, x = plants.run(which, start, before[0], before, np.zeros((1, LANES)))
    step, N = round(settings.interval_s * 1e6), len(source.u)
    chunk = min(CHUNK, N // LEAST_PARTS + 1)
    for k in range(0, N, chunk):
        u = np.repeat(source.u[k : k + chunk, np.newaxis], LANES, axis=1)
        weight = None if source.weight is None else source.weight[k : k + chunk]
        held = None if weight is None else np.repeat(weight[:, np.newaxis], LANES, axis=1)
        y, x = plants.run(which, x, before[0], u, draw(len(u)), held)
        before = u[-1:]
        t_us = source.t_us + step * np.arange(k + 1, k + 1 + len(u), dtype=np.int64)
        yield t_us, u, y, weight


class _Copies:
    """The monitors of all copies."""

    def __init__(self, model: AxisModel, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self._batch = AxisBatch([model] * LANES, [without_tests(settings)] * LANES)

    def run(self, source: CopySource, blocks: MatchedBlocks) -> Iterator[tuple[Floats, Floats]]:
        """Deviations and sqrt(lambda_0 P_ii) (n, p, LANES) of copies of a record, at every q-th sample."""
        model, settings, since = self.model, self.settings, 0
        scale, q = model.scale[:, np.newaxis], stride(settings.memory)
        for a in range(LANES):
            self._batch.restore(a, *source.column)
        for t_us, u, y, weight in bootstrap_copies(model, settings, source, blocks.take):
            times = np.repeat(t_us[:, np.newaxis], LANES, axis=1)
            held = None if weight is None else np.repeat(weight[:, np.newaxis], LANES, axis=1)
            trace = self._batch.trace(times, u, y, weight=held)
            first = max(0, round(SETTLED * settings.memory) - since)
            since += len(u)
            rows = slice(first + q - 1, None, q)
            d = np.ascontiguousarray((trace.theta[rows] - model.theta0[:, np.newaxis]) / scale)
            if len(d):
                yield d, np.sqrt(settings.lam0 * trace.P[rows]) / scale


class _PeakCounter:
    """Collects the peaks of the sums of the tests of all copies."""

    def __init__(self, model: AxisModel, settings: Settings, k: float) -> None:
        p = len(model.scale)
        self._memory, self._k, self._q = settings.memory, k, stride(settings.memory)
        self._g, self._top = np.zeros((2, p, LANES)), np.zeros((2, p, LANES))
        self._largest, self._found = np.zeros((2, p, _ROOM)), np.zeros((2, p), np.int64)
        self._sums, self._counted, self._tested = np.zeros((3, p)), 0, 0
        self._alpha1: Floats | None = None
        self._begun = 0

    def begin(self) -> None:
        """Start with other copies."""
        self._begun += 1
        self._g[...] = self._top[...] = 0.0

    def take(self, d: Floats, s: Floats) -> None:
        """Add deviations and their sqrt(lambda_0 P_ii) (n, p, LANES)."""
        self._sums += [d.sum(axis=(0, 2)), (d * d).sum(axis=(0, 2)), s.sum(axis=(0, 2))]
        self._counted += len(d) * LANES
        if self._alpha1 is None:
            if self._counted * self._q < _KNOWN * self._memory * LANES and self._begun < 2:
                return  # sigma must be known first
            self._alpha1 = self._k * self._sigma() / (self._sums[2] / self._counted)
        least = LEAST * self._sigma() * self._memory / self._q
        excursions(d, s * self._alpha1[:, np.newaxis], self._g, self._top, least, self._largest, self._found)
        self._tested += len(d) * LANES

    def _sigma(self) -> Floats:
        mean = self._sums[0] / self._counted
        return np.asarray(np.sqrt(self._sums[1] / self._counted - mean**2))

    def found(self, error: Floats) -> Excursions:
        """All excursions found, with the error of the copies."""
        assert self._alpha1 is not None
        kept = tuple(
            tuple(self._q * np.sort(row[: min(n, _ROOM)])[::-1] for row, n in zip(rows, ns, strict=True))
            for rows, ns in zip(self._largest, self._found, strict=True)
        )
        nu = self._alpha1 * self._sums[2] / self._counted
        mean, samples = self._sums[0] / self._counted, float(self._tested * self._q)
        return Excursions(nu / self._sigma(), self._sigma(), mean, error, kept, samples)


# --- What copies of healthy records are off by, because the records are short -----------------------------------------


# Copies that each have only a few of the innovations, blocks drawn with replacement, differ from each other by the
# chance of these blocks. All the innovations of the records are chance, too, but less so the more there are (bootstrap
# of a bootstrap: Hall 1992; m out of n: Bickel, Goetze and van Zwet 1997).


PartSums = tuple[Floats, float]
"""Sums of the deviations of a part of the records, and of their squares (2, p, W), and their number."""


def part_sums(d: Floats) -> PartSums:
    """Of the deviations (n, p, W)."""
    return np.stack([d.sum(axis=0), (d * d).sum(axis=0)]), float(len(d))


def own_error(parts: Sequence[PartSums]) -> Floats:
    """Covariance (2 p, 2 p) between copies due to their blocks: of the means, over sigma, and of log sigma.

    More colour makes more bias and more scatter of all parameters that it reaches, so these errors are correlated.
    """
    sums, n = np.array([s for s, _ in parts]), np.array([n for _, n in parts])[:, np.newaxis, np.newaxis]
    of_copy, square = sums.sum(axis=0) / n.sum()
    variance = (square - of_copy**2).mean(axis=-1, keepdims=True)
    record, two = sums[:, 0] / n, sums[:, 1] / n
    louder = (two - 2 * of_copy * record + of_copy**2) / variance
    # Contributions of each part to both, of each copy (R, 2 p, W); their means are those of the copy.
    x = np.concatenate([record / np.sqrt(variance), louder / 2], axis=1)
    R, W = len(x), x.shape[-1]
    means, copies = x.mean(axis=-1, keepdims=True), x.mean(axis=0)
    # Analysis of variance: differences of a copy between parts are chance.
    rest = x - means - copies + means.mean(axis=0)
    chance = np.einsum("riw,rjw->ij", rest, rest) / ((R - 1) * (W - 1)) / R
    return excess_covariance(np.cov(copies), chance, W)


def excess_covariance(seen: Floats, chance: Floats, times: int) -> Floats:
    """The significant part of a covariance (n, n) beyond that of chance (n, n).

    A spiked covariance (Donoho, Gavish and Johnstone 2018): of the eigenvalues, in units of chance, those above what
    chance alone would give with ``times`` draws, less its contribution to them.
    """
    root = np.linalg.cholesky(chance)
    half = np.linalg.solve(root, seen)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    gamma = len(values) / times
    sum_ = np.maximum(values + 1 - gamma, 2 * np.sqrt(np.maximum(values, 0.0)))
    spikes = (sum_ + np.sqrt(np.maximum(sum_**2 - 4 * values, 0.0))) / 2
    stands_out = values > (1 + math.sqrt(gamma)) ** 2
    V = root @ vectors
    return np.asarray((V * np.where(stands_out, spikes - 1, 0.0)) @ V.T)
