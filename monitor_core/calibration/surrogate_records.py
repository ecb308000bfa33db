"""Surrogate records: the motion of a healthy record, its innovations in another order, run through the monitor.

Residual bootstrap (Kreiss and Lahiri 2012) in blocks of the innovations, which keeps their colour.  The recursion
itself runs over the copies, so the autocorrelation and the asymmetry of the estimates are reproduced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz

from monitor_core.arrays import Floats
from monitor_core.calibration.healthy_records import without_tests
from monitor_core.calibration.simulated_copies import Plants, innovations
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.excursions import excursions
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

SAMPLES, OWN_SAMPLES = 32_000_000, 4_000_000
"""That are simulated, for the tests' sums, and at least for what copies are off by."""
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
BINS = 50
"""In a memory: of so many samples one is looked at."""
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
    error, watch = _bootstrap_error(copies, sources, rng), _PeakCounter(model, settings, k)
    progress(1 / (turns + 1))
    for turn in range(turns):
        for source in sources:
            watch.begin()
            for d, s in copies.run(source, bootstrap_blocks(settings, source, MANY, rng)):
                watch.take(d, s)
        progress((turn + 2) / (turns + 1))
    return watch.found(error)


def _bootstrap_error(copies: _Copies, sources: Sequence[CopySource], rng: np.random.Generator) -> Floats:
    """Error covariance (2 p, 2 p) of the copies, scaled from copies with few of the innovations to all of them."""
    few = [bootstrap_blocks(copies.settings, source, FEW, rng) for source in sources]
    parts = PartSums()
    turns = math.ceil(OWN_SAMPLES / LANES / sum(len(source.u) for source in sources))
    for _ in range(turns):
        for source, blocks in zip(sources, few, strict=True):
            for d, _ in copies.run(source, blocks):
                parts.add(d)
        if not parts:
            raise ValueError(f"no record is longer than {SETTLED} memories")
    share = sum(blocks.samples for blocks in few) / sum(len(source.eps) for source in sources)
    return parts.own_error() * share


@dataclass(frozen=True)
class CopySource:
    """What copies of a record are made from, starting where the estimates run."""

    u: Floats
    eps: Floats
    x: Floats
    u_before: float
    column: tuple[Floats, np.ndarray]
    t_us: int


def copy_source(model: AxisModel, settings: Settings, record: SampleBlock) -> CopySource | None:
    """What copies of a record are made from; None where too little was learned in it."""
    monitor, start = AxisMonitor(model, without_tests(settings)), 0
    step = settings.span
    st = monitor.batch.state
    for start in range(0, len(record.t_us), step):
        if start and st.t[0] >= st.settled[0] and not st.seed_left[0]:
            break
        part = record.select(slice(start, start + step))
        monitor.update(part)
    found = innovations(model, settings, record, (start,))
    eps = found.eps[start:]
    eps = eps[np.isfinite(eps)]
    if len(eps) < 2 * settings.memory:
        return None
    column, t_us = monitor.batch.column(0), int(st.t[0])
    return CopySource(
        record.u[start:], eps - eps.mean(), found.x[0], float(record.u[start - 1]), column, t_us
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


class Innovations(Protocol):
    """Innovations of LANES copies."""

    def take(self, count: int) -> Floats:
        """The next (count, LANES)."""


def bootstrap_copies(
    model: AxisModel, settings: Settings, source: CopySource, draw: Innovations
) -> Iterator[tuple[np.ndarray, Floats, Floats]]:
    """LANES copies of a record in chunks, at equal intervals: t_us (N,), u and y (N, LANES)."""
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
        y, x = plants.run(which, x, before[0], u, draw.take(len(u)))
        before = u[-1:]
        t_us = source.t_us + step * np.arange(k + 1, k + 1 + len(u), dtype=np.int64)
        yield t_us, u, y


class _Copies:
    """The monitors of all copies."""

    def __init__(self, model: AxisModel, settings: Settings) -> None:
        self.model, self.settings = model, settings
        self._bank = AxisBatch([model] * LANES, [without_tests(settings)] * LANES)

    def run(self, source: CopySource, blocks: MatchedBlocks) -> Iterator[tuple[Floats, Floats]]:
        """Deviations and sqrt(lambda_0 P_ii) (n, p, LANES) of copies of a record, at every q-th sample."""
        model, settings, since = self.model, self.settings, 0
        scale, q = model.scale[:, np.newaxis], stride(settings)
        for a in range(LANES):
            self._bank.restore(a, *source.column)
        for t_us, u, y in bootstrap_copies(model, settings, source, blocks):
            _, trace = self._bank.run_traced(np.repeat(t_us[:, np.newaxis], LANES, axis=1), u, y)
            first = max(0, round(SETTLED * settings.memory) - since)
            since += len(u)
            rows = slice(first + q - 1, None, q)
            d = np.ascontiguousarray((trace.theta[rows] - model.theta0[:, np.newaxis]) / scale)
            if len(d):
                yield d, np.sqrt(settings.lam0 * trace.P[rows]) / scale


def stride(settings: Settings) -> int:
    """Number of samples from one that is evaluated to the next."""
    return max(1, round(settings.memory / BINS))


class _PeakCounter:
    """Collects the peaks of the sums of the tests of all copies."""

    def __init__(self, model: AxisModel, settings: Settings, k: float) -> None:
        p = len(model.scale)
        self._memory, self._k, self._q = settings.memory, k, stride(settings)
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


# --- Innovations of a record in another order: in blocks that match where they meet -----------------------------------


# The colour of the innovations causes a bias of the estimates, which would be lost if any block could follow any other.
# So the next block is chosen whose past predicts the same as the end of the block before (matched blocks: Carlstein et
# al. 1998).

ALIKE, LEAST_ALIKE = 0.03, 4
"""Blocks that may follow another: this share of all, to either side of the one that matches best, or so many."""
LONGEST = 500
"""Samples of the past that promise anything."""
_TINY = 1e-6


class MatchedBlocks:
    """Endless innovations of copies.

    Each copy has its own blocks, drawn with replacement, and uses them again and again.

    Args:
        eps: innovations of the record (N,), at least two.
        length: samples of a block.
        many: number of blocks of each copy.
        copies: number of copies.
        rng: random generator.
    """

    def __init__(self, eps: Floats, length: int, many: int, copies: int, rng: np.random.Generator) -> None:
        self._eps, self._length, self._rng = eps, min(length, len(eps) - 1), rng
        self._near = min(max(LEAST_ALIKE, round(ALIKE * many)), many)
        promised = predicted_sum(eps, min(max(1, self._length // 2), LONGEST))
        first = rng.integers(1, len(eps) - self._length + 1, (copies, many))
        order = np.argsort(promised[first - 1], axis=1)
        self._first = np.take_along_axis(first, order, axis=1)  # (copies, blocks), by what came before
        before, at_end = promised[self._first - 1], promised[self._first + self._length - 1]
        self._next = np.array([np.searchsorted(*source) for source in zip(before, at_end, strict=True)])
        self._at = rng.integers(0, first.shape[1], copies)
        self._left = np.zeros((0, copies))

    @property
    def samples(self) -> int:
        """Number of samples of a copy, repeated ones included."""
        return self._length * int(self._first.shape[1])

    def take(self, count: int) -> Floats:
        """The next (count, copies)."""
        copies, blocks = np.arange(len(self._at)), self._first.shape[1]
        while len(self._left) < count:
            rows = self._first[copies, self._at] + np.arange(self._length)[:, np.newaxis]
            self._left = np.concatenate([self._left, self._eps[rows]])
            after = self._next[copies, self._at] + self._rng.integers(-self._near, self._near, len(copies))
            after = np.where(after < 0, -1 - after, after)  # reflected at the ends
            self._at = np.where(after < blocks, after, 2 * blocks - 1 - after)
        out, self._left = self._left[:count], self._left[count:]
        return out


def predicted_sum(eps: Floats, lags: int) -> Floats:
    """Best linear prediction (N,), at each sample, of the sum of the next ``lags`` from as many past ones (Wiener)."""
    N, size = len(eps), next_fast_len(len(eps) + 2 * lags + 1, real=True)
    F = rfft(eps, size)
    r = irfft(np.abs(F) ** 2, size)[: 2 * lags + 1]  # autocovariance, by N
    sums = np.cumsum(np.append(0.0, r))
    past = np.arange(1, lags + 1)
    r[0] *= 1 + _TINY
    weights = solve_toeplitz(r[:lags], sums[past + lags] - sums[past])
    return np.asarray(irfft(F * rfft(weights, size), size)[:N])


# --- What copies of healthy records are off by, because the records are short -----------------------------------------


# Copies that each have only a few of the innovations, blocks drawn with replacement, differ from each other by the
# chance of these blocks. All the innovations of the records are chance, too, but less so the more there are (bootstrap
# of a bootstrap: Hall 1992; m out of n: Bickel, Goetze and van Zwet 1997).


@dataclass
class PartSums:
    """Sums over parts of the records, of each of W copies and p parameters."""

    _sums: list[Floats] = field(default_factory=list)
    _counts: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._sums)

    def add(self, d: Floats) -> None:
        """Add deviations (n, p, W) of a part."""
        self._sums.append(np.stack([d.sum(axis=0), (d * d).sum(axis=0)]))
        self._counts.append(float(len(d)))

    def own_error(self) -> Floats:
        """Covariance (2 p, 2 p) between copies due to their blocks: of the means, over sigma, and of log sigma.

        More colour makes more bias and more scatter of all parameters that it reaches, so these errors are correlated.
        """
        x = self._each()
        R, W = len(x), x.shape[-1]
        parts, copies = x.mean(axis=-1, keepdims=True), x.mean(axis=0)
        # Analysis of variance: differences of a copy between parts are chance.
        rest = x - parts - copies + parts.mean(axis=0)
        chance = np.einsum("riw,rjw->ij", rest, rest) / ((R - 1) * (W - 1)) / R
        return excess_covariance(np.cov(copies), chance, W)

    def _each(self) -> Floats:
        """Contribution of each part to both, of each copy (R, 2 p, W); their means are those of the copy."""
        sums, n = np.array(self._sums), np.array(self._counts)[:, np.newaxis, np.newaxis]
        of_copy, square = sums.sum(axis=0) / n.sum()
        variance = (square - of_copy**2).mean(axis=-1, keepdims=True)
        record, two = sums[:, 0] / n, sums[:, 1] / n
        louder = (two - 2 * of_copy * record + of_copy**2) / variance
        return np.concatenate([record / np.sqrt(variance), louder / 2], axis=1)


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
