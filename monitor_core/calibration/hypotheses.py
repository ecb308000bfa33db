"""Thresholds of a bank of hypotheses from healthy records and a false-alarm budget.

For an exact model g goes beyond h about as often as exp(-h) says.  Of a real axis it is exp(-r h), with an r of each
hypothesis: of the records themselves, as what the model lacks goes with their motion, and of copies of them
(surrogate.py), which are as many as the tail needs.  What speaks for a hypothesis all along in some part of a healthy
record is taken from its log-likelihood ratios: the allowance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monitor_core.calibration.budget import LOWER, UPPER
from monitor_core.calibration.healthy import Samples
from monitor_core.calibration.surrogate import MANY, blocks_of, copies_of, source_of
from monitor_core.detection.bank import HypothesisBank, default_hypotheses
from monitor_core.detection.detector import Limit
from monitor_core.detection.hypotheses import Hypothesis
from monitor_core.detection.threshold import ALIKE, BLOCKS, LEAST_HEIGHT
from monitor_core.kernel.hypotheses import Memory
from monitor_core.kernel.tables import Floats
from monitor_core.model import AxisModel
from monitor_core.settings import Settings

COPIES = 2_000_000
"""Samples of copies that the bank is run over."""
TOP = 150
"""Excursions that go highest, which tell the tail."""
_LARGEST = 1.1
"""A threshold is so many times what the healthy records themselves reach, at least."""
_CHUNK = 10_000
_DRAWS = 1000
_SLOW = 2.0
"""Memories, after which innovations run another course."""


@dataclass(frozen=True)
class BankLimits:
    """Limits of all hypotheses; false alarms per sample of the whole bank, most likely, and a 90 % interval.

    ``beyond``: by which factor, at most, a rate is below what was simulated.
    """

    own: tuple[Limit, ...]
    whole: float
    lower: float
    upper: float
    beyond: float


class _Tail(NamedTuple):
    """Excursions above ``base`` happen at the rate exp(log_rate) per sample, and exceed it by h at exp(-r h) of that.

    ``sure`` is the number of excursions that r is known from.
    """

    base: float
    log_rate: float
    r: float
    sure: int


def bank_limits(
    model: AxisModel,
    settings: Settings,
    records: Sequence[Samples],
    samples: float,
    rng: np.random.Generator,
    copies: int = COPIES,
    progress: Callable[[float], None] = lambda _: None,
) -> BankLimits:
    """Thresholds with one false alarm of the whole bank in so many samples, kept with a certainty of 95 %.

    Every hypothesis has the same share of the budget.

    Raises:
        ValueError: the axis can have no bank; nothing was tested in any record.
    """
    bank = HypothesisBank(model, settings, default_hypotheses(model, settings))
    allowance = _allowance(bank, records)
    bank = HypothesisBank(model, settings, bank.hypotheses, allowance=allowance)
    recorded = _Heights(len(bank.hypotheses))
    for one in records:
        _over(bank, one, recorded)
    if not recorded.samples:
        raise ValueError("nothing was tested in any record")
    progress(0.2)
    copied = _copied(bank, records, copies, rng, lambda part: progress(0.2 + 0.8 * part))
    return _limits(bank, allowance, recorded, copied, samples, rng)


def _allowance(bank: HypothesisBank, records: Sequence[Samples]) -> Floats:
    """As ``threshold.allowances``, in pieces."""
    most = np.zeros(len(bank.hypotheses))
    for one in records:
        N = len(one.t_us)
        sums, counts = np.zeros((BLOCKS, len(most))), np.zeros(BLOCKS)
        bank.reset()
        for k in range(0, N, _CHUNK):
            part = one.part(k, k + _CHUNK)
            _, trace = bank.run_traced(part.t_us, part.u, part.y, part.gate, part.shift)
            tested = np.isfinite(trace.llr).any(axis=1)
            of = (k + np.flatnonzero(tested)) * BLOCKS // N
            np.add.at(sums, of, np.where(np.isfinite(trace.llr[tested]), trace.llr[tested], 0.0))
            np.add.at(counts, of, 1.0)
        means = sums[counts > 0] / counts[counts > 0, np.newaxis]
        most = np.maximum(most, 2 * means.max(axis=0, initial=0.0))
    return most


class _Heights:
    """How high g of each hypothesis goes in each of its excursions from zero, from pieces of its course."""

    def __init__(self, many: int) -> None:
        self._found: list[list[Floats]] = [[] for _ in range(many)]
        self.largest = np.zeros(many)
        self.samples = 0

    def take(self, g: Floats, top: Floats) -> None:
        """g (N, H); ``top`` (H,) is the largest of the excursion that goes on, and becomes that of the next piece."""
        self.largest = np.maximum(self.largest, g.max(axis=0, initial=0.0))
        for i, found in enumerate(self._found):
            course = g[:, i]
            zeros = np.flatnonzero(course == 0.0)
            if not len(zeros):
                top[i] = max(top[i], course.max(initial=0.0))
                continue
            heights = np.maximum.reduceat(course, zeros)
            first = max(top[i], course[: zeros[0]].max(initial=0.0))
            heights, top[i] = np.append(heights[:-1], first), heights[-1]
            found.append(heights[heights > LEAST_HEIGHT])

    def tail(self, i: int) -> _Tail:
        """Of a hypothesis; with few excursions as an exact model has it."""
        heights = np.sort(np.concatenate([*self._found[i], np.empty(0)]))[::-1]
        used = heights[:TOP]
        base = float(used[-1]) if len(heights) > TOP else LEAST_HEIGHT
        alike = 0 if len(used) == TOP else ALIKE
        r = (len(used) + alike) / (float((used - base).sum()) + alike)
        return _Tail(base, float(np.log(max(len(used), 1) / self.samples)), min(r, 1.0), len(used) + alike)


def _over(bank: HypothesisBank, one: Samples, heights: _Heights) -> None:
    """One record, from the start."""
    bank.reset()
    top = np.zeros(len(bank.hypotheses))
    for k in range(0, len(one.t_us), _CHUNK):
        part = one.part(k, k + _CHUNK)
        _, trace = bank.run_traced(part.t_us, part.u, part.y, part.gate, part.shift)
        heights.take(trace.g, top)
        heights.samples += int(np.isfinite(trace.llr).any(axis=1).sum())


def _copied(
    bank: HypothesisBank,
    records: Sequence[Samples],
    samples: int,
    rng: np.random.Generator,
    progress: Callable[[float], None],
) -> _Heights:
    """Copies of the records, at least so many samples."""
    sources = [of for one in records if (of := source_of(bank.model, bank.settings, one)) is not None]
    heights = _Heights(len(bank.hypotheses))
    while sources and heights.samples < samples:
        for source in sources:
            memories: list[Memory] = []
            tops: list[Floats] = []
            draw = blocks_of(bank.settings, source, MANY, rng)
            for t_us, u, y in copies_of(bank.model, bank.settings, source, draw):
                for a in range(u.shape[1]):
                    if len(memories) <= a:
                        bank.reset()
                        tops.append(np.zeros(len(bank.hypotheses)))
                    else:
                        bank.memory = memories[a]
                    _, trace = bank.run_traced(t_us, u[:, a], y[:, a])
                    memories[a : a + 1] = [bank.memory]
                    heights.take(trace.g, tops[a])
                    heights.samples += int(np.isfinite(trace.llr).any(axis=1).sum())
                progress(min(1.0, heights.samples / samples))
                if heights.samples >= samples:
                    break
    return heights


def _limits(
    bank: HypothesisBank,
    allowance: Floats,
    recorded: _Heights,
    copied: _Heights,
    samples: float,
    rng: np.random.Generator,
) -> BankLimits:
    many = len(bank.hypotheses)
    log_share = -float(np.log(max(samples, 1.0) * many))
    own: list[Limit] = []
    drawn, beyond = np.zeros(_DRAWS), 0.0
    tails = _paired(bank.hypotheses, [(copied if copied.samples else recorded).tail(i) for i in range(many)])
    # How far g goes is told by the slow course of the innovations, of which the records have so many blocks.
    blocks = max(recorded.samples / (_SLOW * bank.settings.memory), 2.0)
    alike = rng.gamma(blocks / 2, 2 / blocks, _DRAWS)
    for i, of in enumerate(bank.hypotheses):
        tail, seen = tails[i], recorded.tail(i)
        r = tail.r * alike * rng.gamma(tail.sure, 1 / tail.sure, _DRAWS)
        low = float(np.quantile(r, 1 - UPPER))
        h = max(
            tail.base + max(0.0, tail.log_rate - log_share) / low,
            seen.base + max(0.0, seen.log_rate - log_share) / seen.r,
            _LARGEST * float(recorded.largest[i]),
        )
        own.append(Limit(of.cause, of.size, h, float(allowance[i]), of.alike))
        drawn += np.exp(tail.log_rate - r * (h - tail.base))
        beyond = max(beyond, tail.r * (h - tail.base))
    lower, whole, upper = (float(v) for v in np.quantile(drawn, [LOWER, 0.5, UPPER]))
    return BankLimits(tuple(own), whole, lower, upper, float(np.exp(beyond)))


def _paired(hypotheses: Sequence[Hypothesis], tails: Sequence[_Tail]) -> list[_Tail]:
    """Up and down differ by chance only: both have the flatter tail of the two."""
    least: dict[tuple[str, float], float] = {}
    for of, tail in zip(hypotheses, tails, strict=True):
        key = of.cause, abs(of.size)
        least[key] = min(tail.r, least.get(key, 1.0))
    return [
        tail._replace(r=least.get((of.cause, abs(of.size)), tail.r))
        for of, tail in zip(hypotheses, tails, strict=True)
    ]
