"""Excursions of the CUSUM sums in bootstrap copies of healthy records.

The recursion itself runs over the copies, so the autocorrelation and the asymmetry of the estimates are reproduced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.matched_blocks import MatchedBlocks
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.own_error import PartSums, own_error, part_sums
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
"""Numbers of simulated samples: for the excursions, and at most for the error of the copies."""
MANY, FEW, FEWEST = 8.0, 0.125, 8
"""Blocks of a copy over those of the record: with MANY all copies are alike, with FEW they differ.  FEWEST: the least
number of blocks of a copy."""
SETTLED = 3
"""Memories until the deviations have forgotten their start."""
LEAST = 0.5
"""Only excursions above this are kept, in sigma times memory."""
_ROOM, _KNOWN = 300_000, 50


@dataclass(frozen=True)
class Excursions:
    """Peaks of the CUSUM sums in each excursion from zero, largest first; [direction][parameter].

    In sizes times samples, of tests with nu over sigma = k (p,), in ``samples`` of each test.
    """

    k: Floats
    sigma: Floats
    mean: Floats
    """Mean of the deviation, in sizes (p,)"""
    error: Floats
    """Covariance (2 p, 2 p) of the errors of the copies: of mean over sigma, and of log sigma (``own_error``)"""
    largest: tuple[tuple[Floats, ...], ...]
    samples: float


def simulate_excursions(
    axis: MonitoredAxis,
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
    sources = [source for record in records if (source := copy_source(axis, record)) is not None]
    if not sources:
        raise ValueError("nothing was learned from any record")
    copies = _Copies(axis)
    total = sum(len(source.u) for source in sources)
    # sigma comes from the first memories; short records are run once more for it.
    least = 1 if total > 4 * _KNOWN * axis.settings.memory else 2
    turns = max(least, round(samples / total / LANES))
    error = _bootstrap_error(copies, sources, rng, min(OWN_SAMPLES, samples))
    watch = _PeakCounter(axis, k)
    progress(1 / (turns + 1))
    for turn in range(turns):
        for source in sources:
            watch.begin()
            for d, s in copies.run(source, _bootstrap_blocks(axis.settings, source, MANY, rng)):
                watch.take(d, s)
        progress((turn + 2) / (turns + 1))
    return watch.found(error)


def _bootstrap_error(
    copies: _Copies, sources: Sequence[CopySource], rng: np.random.Generator, samples: int
) -> Floats:
    """Error covariance (2 p, 2 p) of the copies, scaled from copies with few of the innovations to all of them."""
    few = [_bootstrap_blocks(copies.axis.settings, source, FEW, rng) for source in sources]
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


def _bootstrap_blocks(
    settings: Settings, source: CopySource, share: float, rng: np.random.Generator
) -> MatchedBlocks:
    """Innovations for LANES copies of a record, each drawn from a share of those of the record."""
    length = block_length(settings)
    return MatchedBlocks(source.eps, length, max(FEWEST, round(share * len(source.eps) / length)), LANES, rng)


class _Copies:
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
            first = max(0, round(SETTLED * settings.memory) - since)
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
