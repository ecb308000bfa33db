"""Runs the multi-model detector over healthy records, and over enough bootstrap copies of them to know its tails.

The copies have the motion of the records, because model errors depend on the motion, and synthetic innovations
(innovation_bootstrap.py).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.calibration.innovation_bootstrap import SieveBootstrap
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.multimodel_tails import ExcursionPeaks
from monitor_core.calibration.spectra import Spectra
from monitor_core.calibration.surrogate_records import LANES, block_length, bootstrap_copies, copy_source
from monitor_core.detection.multimodel.hypothesis import Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import MEMORIES, HypothesisBank
from monitor_core.detection.multimodel.naming import CausePosterior
from monitor_core.samples import SampleBlock
from monitor_core.settings import MODEL_ERRORS, Settings

COPY_SAMPLES = 8_000_000
"""Number of samples of copies over which the bank is run."""
RECORD_PARTS = 8
"""Number of parts of a record; the allowance makes the mean evidence for a hypothesis negative in each of them."""
SEGMENT_BLOCKS = 2
"""Length, in blocks, of the segments for the power of the innovations: an offset needs it close to frequency zero."""
_CHUNK_SAMPLES = 10_000


@dataclass(frozen=True)
class MultiModelStatistics:
    """Excursions of a bank on healthy records (``recorded``) and on copies of them.

    Without copies the records also stand for them.  ``allowance``, ``size_error`` (H,): see HealthyEvidence.
    ``covariance`` (H, H): covariance of log r (spectra.py).  ``places``: number of blocks of the motion.
    """

    hypotheses: tuple[Hypothesis, ...]
    allowance: Floats
    size_error: Floats
    recorded: ExcursionPeaks
    copied: ExcursionPeaks
    covariance: Floats
    places: int


def multimodel_statistics(
    axis: MonitoredAxis,
    records: Sequence[SampleBlock],
    rng: np.random.Generator,
    copies: int = COPY_SAMPLES,
    progress: Callable[[float], None] = lambda _: None,
) -> MultiModelStatistics:
    """Run the bank over the records, and over ``copies`` samples of bootstrap copies.

    Raises:
        ValueError: the detector is not available for the axis; no record has tested samples.
    """
    bank = HypothesisBank(*axis)
    found = [healthy_evidence(bank, moved) for moved in _with_moved_nominal(axis, records)]
    allowance = np.max([each.allowance for each in found], axis=0)
    bank = HypothesisBank(*axis, bank.hypotheses, allowance=allowance)
    variance = axis.settings.lam0 * np.array([1.0, *(hypothesis.variance for hypothesis in bank.hypotheses)])
    recorded, places = ExcursionPeaks(len(allowance)), _Blocks(axis.settings, records)
    spectra = Spectra(variance, allowance, SEGMENT_BLOCKS * block_length(axis.settings))
    for number, record in enumerate(records):
        spectra.add(_run_record(bank, record, recorded, places, number))
    if not recorded.samples:
        raise ValueError("no record has tested samples")
    progress(0.2)
    copied = _run_copies(bank, records, places, copies, rng, lambda part: progress(0.2 + 0.8 * part))
    pooled = copied if copied.samples else recorded
    covariance = spectra.covariance()
    return MultiModelStatistics(
        bank.hypotheses, allowance, _with_model_error(found), recorded, pooled, covariance, places.many
    )


class HealthyEvidence(NamedTuple):
    """Evidence for each hypothesis (H,) in healthy records."""

    allowance: Floats
    """Subtracted from each log-likelihood ratio, so that its mean is positive in no part of a record"""
    size_error: Floats
    """Standard deviation of the apparent size of the cause on a healthy axis, beyond that of the likelihood"""


def healthy_evidence(bank: HypothesisBank, records: Sequence[SampleBlock]) -> HealthyEvidence:
    """Evidence of a bank without allowances in healthy records.

    Sizes are computed from the evidence of MEMORIES memory lengths, as in alarms.
    """
    most = np.zeros(len(bank.hypotheses))
    window, spans = round(MEMORIES * bank.settings.memory), list[Floats]()
    for record in records:
        N, first = len(record.t_us), 0
        sums, counts = np.zeros((RECORD_PARTS, len(most))), np.zeros(RECORD_PARTS)
        of_spans = np.zeros((1 + N // window, len(most)))
        bank.reset()
        for k in range(0, N, _CHUNK_SAMPLES):
            part = record.select(slice(k, k + _CHUNK_SAMPLES))
            _, trace = bank.run_traced(part)
            tested = np.isfinite(trace.llr).any(axis=1)
            llr = np.where(np.isfinite(trace.llr[tested]), trace.llr[tested], 0.0)
            index = (k + np.flatnonzero(tested)) * RECORD_PARTS // N
            np.add.at(sums, index, llr)
            np.add.at(counts, index, 1.0)
            np.add.at(of_spans, (first + np.arange(len(llr))) // window, llr)
            first += len(llr)
        means = sums[counts > 0] / counts[counts > 0, np.newaxis]
        most = np.maximum(most, 2 * means.max(axis=0, initial=0.0))
        spans.append(of_spans[: first // window])
    return HealthyEvidence(most, _size_errors(bank.hypotheses, np.concatenate(spans)))


def _size_errors(hypotheses: Sequence[Hypothesis], evidence: Floats) -> Floats:
    """``HealthyEvidence.size_error`` (H,) from the evidence in spans of the records (spans, H)."""
    causes, found = CausePosterior(hypotheses), dict[str, list[float]]()
    for of_span in evidence:
        for share in causes.shares(of_span):
            if math.isfinite(share.size_sd):
                found.setdefault(share.cause, []).append(share.size**2 - share.size_sd**2)
    errors = {cause: math.sqrt(max(float(np.mean(excess)), 0.0)) for cause, excess in found.items()}
    return np.array([errors.get(hypothesis.cause, 0.0) for hypothesis in hypotheses])


def _with_moved_nominal(axis: MonitoredAxis, records: Sequence[SampleBlock]) -> Iterator[Sequence[SampleBlock]]:
    """The records; then the records with each nominal value moved up and down by its allowed model error."""
    yield records
    p = len(axis.model.monitored)
    for i, error in enumerate(axis.settings.model_errors(p) * axis.model.scale):
        for step in (error, -error) if error > 0 else ():
            move = np.where(np.arange(p) == i, step, 0.0)
            shifts = [np.zeros((r.size, p)) if r.shift is None else r.shift for r in records]
            yield [r._replace(shift=shift + move) for r, shift in zip(records, shifts, strict=True)]


def _with_model_error(found: Sequence[HealthyEvidence]) -> Floats:
    """Errors of sizes (H,), from the records and from those with moved nominal values.

    The nominal values were moved by MODEL_ERRORS standard deviations, and the errors of sizes are proportional to that.
    """
    first, *moved = (each.size_error**2 for each in found)
    more = np.max([np.maximum(squared - first, 0.0) for squared in moved], axis=0, initial=0.0)
    return np.asarray(np.sqrt(first + more / MODEL_ERRORS**2))


class _Blocks:
    """Numbers the blocks of the records; a block is as long as a block of innovations."""

    def __init__(self, settings: Settings, records: Sequence[SampleBlock]) -> None:
        self._length = block_length(settings)
        self._first = np.cumsum([0, *(1 + len(record.t_us) // self._length for record in records)])
        self.many = int(self._first[-1])

    def index(self, record: int, samples: Ints) -> Ints:
        """Block numbers of samples of a record."""
        return np.asarray(self._first[record] + samples // self._length)


def _run_record(
    bank: HypothesisBank, record: SampleBlock, heights: ExcursionPeaks, places: _Blocks, number: int
) -> Iterator[Floats]:
    """Run one record from the start; yields its innovations (n, 1 + H), part by part."""
    bank.reset()
    course = heights.course()
    for k in range(0, len(record.t_us), _CHUNK_SAMPLES):
        part = record.select(slice(k, k + _CHUNK_SAMPLES))
        _, trace = bank.run_traced(part, reference=True)
        at_places = places.index(number, np.arange(k, k + len(part.t_us)))
        heights.take(trace.g[:, 1:], k, at_places, at_places, course)
        heights.samples += int(np.isfinite(trace.llr[:, 1:]).any(axis=1).sum())
        yield trace.eps


def _run_copies(
    bank: HypothesisBank,
    records: Sequence[SampleBlock],
    places: _Blocks,
    samples: int,
    rng: np.random.Generator,
    progress: Callable[[float], None],
) -> ExcursionPeaks:
    """Run copies of the records, at least ``samples`` in all."""
    heights, clock = ExcursionPeaks(len(bank.hypotheses)), 0
    axis = MonitoredAxis(bank.model, bank.settings)
    found = enumerate(copy_source(axis, record) for record in records)
    sources = [(number, source) for number, source in found if source is not None]
    while sources and heights.samples < samples:
        for number, source in sources:
            copies = BankCopies(bank, heights, clock, len(source.u))
            at, skipped = 0, len(records[number].t_us) - len(source.u)
            sieve = SieveBootstrap(source.eps, LANES, rng)
            for t_us, u, y, weight in bootstrap_copies(axis, source, sieve.take):
                at_places = places.index(number, skipped + at + np.arange(len(t_us)))
                copies.run(t_us, u, y, at, at_places, places.index(number, skipped + sieve.origin), weight)
                at += len(t_us)
                progress(min(1.0, heights.samples / samples))
                if heights.samples >= samples:
                    break
            clock += LANES * len(source.u)
    return heights


class BankCopies:
    """LANES copies of a record, run one after the other through one bank."""

    def __init__(self, bank: HypothesisBank, heights: ExcursionPeaks, clock: int, length: int) -> None:
        self._bank, self._heights, self._clock, self._length = bank, heights, clock, length
        bank.reset()
        self._memories = [bank.memory] * LANES
        self._courses = [heights.course() for _ in range(LANES)]

    def run(
        self,
        t_us: Ints,
        u: Floats,
        y: Floats,
        at: int,
        place: Ints,
        origin: Ints,
        weight: Floats | None = None,
    ) -> None:
        """Run the next samples, u and y (N, LANES), weight (N,), which begin with sample number ``at``.

        ``place`` (N,): blocks of the motion.  ``origin`` (N, LANES): blocks of the innovations.
        """
        for a in range(LANES):
            self._bank.memory = self._memories[a]
            _, trace = self._bank.run_traced(SampleBlock(t_us, u[:, a], y[:, a], weight=weight))
            self._memories[a] = self._bank.memory
            clock, index = self._clock + a * self._length + at, np.ascontiguousarray(origin[:, a])
            self._heights.take(trace.g, clock, place, index, self._courses[a])
            self._heights.samples += int(np.isfinite(trace.llr).any(axis=1).sum())
