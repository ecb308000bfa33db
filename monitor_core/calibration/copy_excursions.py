"""Excursions of the CUSUM sums in bootstrap copies of healthy records, and the error of these copies.

The recursion itself runs over the copies, so the autocorrelation and the asymmetry of the estimates are reproduced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.innovation_bootstrap import MatchedBlocks
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.scatter import stride
from monitor_core.calibration.surrogate_records import (
    LANES,
    CopySource,
    block_length,
    bootstrap_copies,
    copy_source,
)
from monitor_core.kernel.excursions import excursions
from monitor_core.monitoring import AxisBatch
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

SAMPLES, OWN_SAMPLES = 32_000_000, 4_000_000
"""Numbers of simulated samples: for the excursions, and (at most) for the error of the copies."""
MANY_BLOCKS, FEW_BLOCKS, MIN_BLOCKS = 8.0, 0.125, 8
"""Ratios of the number of blocks of a copy to that of the record: with many, all copies are alike; with few, they
differ.  MIN_BLOCKS: least number of blocks of a copy."""
SETTLING_MEMORIES = 3
"""Memories until the deviations have forgotten their start."""
MIN_EXCURSION = 0.5
"""Only excursions above this are kept, in sigma times memory."""
_CAPACITY, _SIGMA_MEMORIES = 300_000, 50
"""Largest number of kept peaks; memories of deviations from which sigma is computed"""


@dataclass(frozen=True)
class Excursions:
    """Peaks of the excursions of the CUSUM sums from zero, in sizes times samples.

    ``largest``: the peaks by direction and parameter, the largest first.  The tests have nu over sigma = ``k`` (p,) and
    ran over ``samples`` samples each.
    """

    k: Floats
    sigma: Floats
    mean: Floats
    """Mean of the deviation, in sizes (p,)"""
    error: Floats
    """Covariance (2 p, 2 p) of the errors of the copies: of mean over sigma, and of log sigma (``copy_covariance``)"""
    largest: tuple[tuple[Floats, ...], ...]
    samples: float


def simulate_excursions(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    k: float,
    rng: np.random.Generator,
    samples: int,
    progress: Callable[[float], None] = lambda _: None,
) -> Excursions:
    """Excursions of the sums of tests with nu = k sigma, over ``samples`` samples of copies.

    Raises:
        ValueError: no record has innovations, or no record is long enough.
    """
    sources = [source for record in records if (source := copy_source(axis, record)) is not None]
    if not sources:
        raise ValueError("no record has enough innovations")
    copies = _MonitoredCopies(axis)
    total = sum(len(source.u) for source in sources)
    # sigma comes from the first memories; short records need a second turn for it.
    least = 1 if total > 4 * _SIGMA_MEMORIES * axis.settings.memory else 2
    turns = max(least, round(samples / total / LANES))
    error = _bootstrap_error(copies, sources, rng, min(OWN_SAMPLES, samples))
    watch = _PeakCounter(axis, k)
    progress(1 / (turns + 1))
    for turn in range(turns):
        for source in sources:
            watch.begin()
            for d, s in copies.run(source, _bootstrap_blocks(axis.settings, source, MANY_BLOCKS, rng)):
                watch.take(d, s)
        progress((turn + 2) / (turns + 1))
    return watch.found(error)


def _bootstrap_error(
    copies: _MonitoredCopies, sources: Sequence[CopySource], rng: np.random.Generator, samples: int
) -> Floats:
    """Error covariance (2 p, 2 p) of the copies: that of copies with few innovations, scaled to all innovations."""
    few = [_bootstrap_blocks(copies.axis.settings, source, FEW_BLOCKS, rng) for source in sources]
    parts: list[PartSums] = []
    turns = math.ceil(samples / LANES / sum(len(source.u) for source in sources))
    for _ in range(turns):
        for source, blocks in zip(sources, few, strict=True):
            for d, _ in copies.run(source, blocks):
                parts.append(part_sums(d))
        if not parts:
            raise ValueError(f"no record is longer than {SETTLING_MEMORIES} memories")
    share = sum(blocks.samples for blocks in few) / sum(len(source.eps) for source in sources)
    return copy_covariance(parts) * share


def _bootstrap_blocks(settings: Settings, source: CopySource, share: float, rng: np.random.Generator) -> MatchedBlocks:
    """Innovations for LANES copies of a record; each copy uses this share of the record's innovations."""
    length = block_length(settings)
    return MatchedBlocks(source.eps, length, max(MIN_BLOCKS, round(share * len(source.eps) / length)), LANES, rng)


class _MonitoredCopies:
    """The monitors of all copies."""

    def __init__(self, axis: MonitoredAxis) -> None:
        self.axis = axis
        self._batch = AxisBatch([axis.model] * LANES, [axis.without_tests.settings] * LANES)

    def run(self, source: CopySource, blocks: MatchedBlocks) -> Iterator[tuple[Floats, Floats]]:
        """Deviations and sqrt(lambda_0 P_ii) (n, p, LANES) of copies of a record, at every q-th sample."""
        (model, settings), since = self.axis, 0
        scale, q = model.scale[:, np.newaxis], stride(settings.memory)
        for a in range(LANES):
            self._batch.restore(a, *source.column)
        for t_us, u, y, weight in bootstrap_copies(self.axis, source, blocks.take):
            times = np.repeat(t_us[:, np.newaxis], LANES, axis=1)
            held = None if weight is None else np.repeat(weight[:, np.newaxis], LANES, axis=1)
            trace = self._batch.trace(times, u, y, weight=held)
            first = max(0, round(SETTLING_MEMORIES * settings.memory) - since)
            since += len(u)
            rows = slice(first + q - 1, None, q)
            d = np.ascontiguousarray((trace.theta[rows] - model.theta0[:, np.newaxis]) / scale)
            if len(d):
                yield d, np.sqrt(settings.lam0 * trace.P[rows]) / scale


class _PeakCounter:
    """Collects the peaks of the sums of the tests of all copies."""

    def __init__(self, axis: MonitoredAxis, k: float) -> None:
        p = len(axis.model.scale)
        self._memory, self._k, self._q = axis.settings.memory, k, stride(axis.settings.memory)
        self._g, self._top = np.zeros((2, p, LANES)), np.zeros((2, p, LANES))
        self._largest, self._found = np.zeros((2, p, _CAPACITY)), np.zeros((2, p), np.int64)
        self._sums, self._counted, self._tested = np.zeros((3, p)), 0, 0
        self._alpha1: Floats | None = None
        self._begun = 0

    def begin(self) -> None:
        """Start the sums again, for other copies."""
        self._begun += 1
        self._g[...] = self._top[...] = 0.0

    def take(self, d: Floats, s: Floats) -> None:
        """Add deviations and their sqrt(lambda_0 P_ii) (n, p, LANES)."""
        self._sums += [d.sum(axis=(0, 2)), (d * d).sum(axis=(0, 2)), s.sum(axis=(0, 2))]
        self._counted += len(d) * LANES
        if self._alpha1 is None:
            if self._counted * self._q < _SIGMA_MEMORIES * self._memory * LANES and self._begun < 2:
                return  # sigma must be known first
            self._alpha1 = self._k * self._sigma() / (self._sums[2] / self._counted)
        least = MIN_EXCURSION * self._sigma() * self._memory / self._q
        excursions(d, s * self._alpha1[:, np.newaxis], self._g, self._top, least, self._largest, self._found)
        self._tested += len(d) * LANES

    def _sigma(self) -> Floats:
        mean = self._sums[0] / self._counted
        return np.asarray(np.sqrt(self._sums[1] / self._counted - mean**2))

    def found(self, error: Floats) -> Excursions:
        """All excursions, with the given error of the copies."""
        assert self._alpha1 is not None
        kept = tuple(
            tuple(self._q * np.sort(row[: min(n, _CAPACITY)])[::-1] for row, n in zip(rows, ns, strict=True))
            for rows, ns in zip(self._largest, self._found, strict=True)
        )
        nu = self._alpha1 * self._sums[2] / self._counted
        mean, samples = self._sums[0] / self._counted, float(self._tested * self._q)
        return Excursions(nu / self._sigma(), self._sigma(), mean, error, kept, samples)


# --- Error of the copies, because the records are short ---------------------------------------------------------------


# Copies made of only a few blocks of innovations, drawn with replacement, differ from each other by the choice of these
# blocks.  The innovations of the records are a random choice, too, with an error that falls with their number.  So the
# differences between such copies, scaled by the numbers, give the error of the copies (bootstrap of a bootstrap: Hall
# 1992; m out of n: Bickel, Goetze and van Zwet 1997).

PartSums = tuple[Floats, float]
"""Sums over a part of the records of the deviations and of their squares (2, p, W), and its number of samples"""


def part_sums(d: Floats) -> PartSums:
    """Sums of the deviations d (n, p, W) of a part of the records."""
    return np.stack([d.sum(axis=0), (d * d).sum(axis=0)]), float(len(d))


def copy_covariance(parts: Sequence[PartSums]) -> Floats:
    """Covariance (2 p, 2 p) between copies due to their blocks, of the means over sigma and of log sigma.

    These errors are correlated: stronger autocorrelation of the innovations increases the bias and the scatter of all
    parameters that it affects.
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
    """The significant part of an observed covariance ``seen`` (n, n) beyond that of chance (n, n).

    Uses the spiked covariance model (Donoho, Gavish and Johnstone 2018): only eigenvalues, in units of chance, above
    the largest that chance alone would give with ``times`` draws are kept, less the contribution of chance.
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
