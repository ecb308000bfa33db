"""Predictors of the multi-model detector of one axis: turns samples into detected, identified and ended changes."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.multimodel.active_faults import ActiveFaults
from monitor_core.detection.multimodel.bank_evidence import LOOKS, BankEvidence
from monitor_core.detection.multimodel.hypothesis import HEALTHY, Hypothesis, moved_model, steps
from monitor_core.detection.multimodel.isolability import default_hypotheses
from monitor_core.detection.multimodel.lanes import Tests, lanes_of, memory_of
from monitor_core.detection.multimodel.naming import (
    CauseEnded,
    CauseIdentified,
    CausePosterior,
    ChangeDetected,
    Event,
    Share,
    SizeCorrected,
)
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.kernel import hypotheses as kernel
from monitor_core.kernel.hypotheses import BankTrace, Block, Memory, run_hypotheses
from monitor_core.kernel.likelihood import SINCE_DETECTION, G
from monitor_core.kernel.predictors import SETTLES, Predictors
from monitor_core.kernel.state import NEVER, USED
from monitor_core.kernel.tables import Tables
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

SURE_ENOUGH = 0.999
"""Probability from which the likeliest cause is named."""
MEMORIES = 3
"""If no cause reaches that probability, the likeliest is named after this number of memory lengths; as many later the
size is refined."""
CORRECTED_AFTER = 6
"""Memory lengths after that until the size is corrected."""
PATIENCE = 2
"""Factor on the waiting time for a cause of last resort: until there is more evidence, a change that no hypothesis fits
well looks like one of these, too."""
_NO_TRACE = BankTrace(*[np.empty((0, 0))] * 3)
_ALWAYS, _AS_BEFORE = np.empty((0, 1), np.bool_), np.empty(0)
"""Stand for an absent gate, and an absent weight"""
_REMEMBERED = 256
"""Number of predictors that are kept, for active faults and positions of the nominal values: these recur with the pose,
and after a fault that has ended."""


class HypothesisBank:
    """Predictors of one axis, one for each hypothesis.

    When a cause has been identified, the bank restarts around the changed axis.  So it detects a second change, and the
    end of the first one.

    Args:
        model: nominal values; the causes are the monitored parameters and faults of the sensors.
        settings: predictor, gaps, lambda_0, memory.
        hypotheses: changes to detect; default ``candidates``.
        h: thresholds, one or (len(hypotheses),).
        allowance: subtracted from each log-likelihood ratio for differences between healthy records; one or
            (len(hypotheses),).
        evidence_share: share of the evidence that counts for the probabilities of causes, above 0, at most 1.

    Raises:
        ValueError: thresholds or a share that do not fit, a hypothesis that the drive cannot have, or a predictor that
            is not stable.
    """

    def __init__(
        self,
        model: AxisModel,
        settings: Settings,
        hypotheses: Sequence[Hypothesis] | None = None,
        h: float | Floats = math.inf,
        allowance: float | Floats = 0.0,
        evidence_share: float = 1.0,
    ) -> None:
        self.model, self.settings = model, settings
        self.evidence_share = evidence_share
        chosen = default_hypotheses(model, settings) if hypotheses is None else hypotheses
        self.active_faults = ActiveFaults(model, settings, chosen)
        many = len(self.hypotheses)
        self.h, self.allowance = (np.broadcast_to(np.asarray(v, float), (many,)) for v in (h, allowance))
        """Thresholds and allowances (len(hypotheses),)"""
        if many == 0 or not (self.h > 0).all() or not np.isfinite(self.allowance).all():
            raise ValueError(f"{many} hypotheses, h = {h}, allowance = {allowance}: need h > 0")
        if not 0 < evidence_share <= 1:
            raise ValueError(f"evidence_share = {evidence_share}: need a number above 0, at most 1")
        errors = dict(zip(model.monitored, settings.model_errors(len(model.monitored)), strict=True))
        follows = np.array([errors.get(hypothesis.cause, 0.0) > 0 for hypothesis in self.hypotheses])
        self._tolerated: Floats = np.where(follows, self.allowance, 0.0)
        """Part of the allowance for model errors of nominal values (len(hypotheses),).  It makes the detection of a
        change harder, most of all of a small one; but after a detection it must not favour any other cause."""
        self._last_resort = {hypothesis.cause for hypothesis in self.hypotheses if hypothesis.weight < 1}
        slowest_s = slowest_time_constant(model, settings.gain(len(model.drive.states)), settings.interval_s)
        if not math.isfinite(slowest_s):
            raise ValueError("the predictor is not stable: hypotheses need a filter gain K")
        self._slowest_us = round(1e6 * slowest_s)
        self.moved = (0,) * len(model.monitored)
        """Position of the nominal values, in steps (hypothesis.py) from those of the model"""
        self._known: dict[tuple[bytes, tuple[int, ...]], tuple[Tables, Predictors]] = {}
        self._around = b"not built"
        """The active faults around which the lanes were built"""
        self._build()
        self._lanes = np.arange(self._predictors.own.shape[1])
        self._memory = memory_of(self._tables, len(self._lanes))

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Hypotheses of the bank."""
        return self.active_faults.hypotheses

    @property
    def memory(self) -> Memory:
        """A copy of the state, for a bank with the same hypotheses and active faults."""
        return _copy(self._memory)

    @memory.setter
    def memory(self, memory: Memory) -> None:
        self._memory = _copy(memory)

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.active_faults.clear()
        self._build()
        self.follow((0,) * len(self.moved))
        self._memory = memory_of(self._tables, len(self._lanes))

    def _build(self) -> None:
        """Build the lanes around the active faults, if these have changed."""
        around = self.active_faults.to_array().tobytes()
        if around != self._around:
            self._around = around
            self._hypotheses = self.active_faults.lanes()
            self._causes = CausePosterior(self._hypotheses[1:], self.evidence_share)
            back_h = float(np.median(self.h)) if self.active_faults else math.inf
            parts = (self.allowance, self._tolerated, self.active_faults.unexplained())
            self._tests = Tests(
                np.concatenate([[np.inf], self.h, [back_h]]), *(np.concatenate([[0.0], p, [0.0]]) for p in parts)
            )
        self.follow(self.moved)

    def follow(self, moved: tuple[int, ...]) -> None:
        """Move the hypotheses to this position of the nominal values, in steps."""
        self.moved = moved
        key = self._around, moved
        if key not in self._known:
            while len(self._known) >= _REMEMBERED:
                del self._known[next(iter(self._known))]
            model = moved_model(self.model, moved)
            self._known[key] = lanes_of(model, self.settings, self._hypotheses, self._tests)
        self._tables, self._predictors = self._known[key]

    def adopt(self, active_faults: Mapping[str, float], since_us: int | None) -> None:
        """Make exactly these causes active, with these sizes (NaN: the cause has no size).

        ``since_us``: time at which a further change was detected, if any; it is identified again, as its evidence is
        lost.
        """
        self.active_faults.adopt(active_faults)
        self._start(0)
        if since_us is not None:
            self._await_name(since_us)
            self._memory.integers[kernel.WAIT, 0] = max(1, round(self.settings.memory / LOOKS))

    def _await_name(self, since_us: int) -> None:
        """Start the identification of a change that was detected at this time."""
        integers = self._memory.integers
        integers[kernel.PHASE, 0] = kernel.PENDING
        integers[kernel.CHECKS, 0], integers[kernel.SINCE, 0] = 0, since_us
        self._memory.sums[SINCE_DETECTION] = 0.0

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that may be named."""
        return self.active_faults.causes

    @property
    def tested_samples(self) -> int:
        """Number of samples that were tested."""
        return int(self._memory.integers[kernel.COUNTS + USED, 0])

    def leading(self) -> tuple[str, float]:
        """The cause with the largest g / h, and that ratio."""
        many = len(self.hypotheses)
        share = self._memory.sums[G, 1 : many + 1] / self.h
        k = int(share.argmax())
        return self.hypotheses[k].cause, float(share[k])

    def to_arrays(self) -> dict[str, NDArray[np.generic]]:
        """The state to save, as arrays by name."""
        named = {f"memory_{name}": array.copy() for name, array in self._memory._asdict().items()}
        return named | {"standing": self.active_faults.to_array(), "moved": np.array(self.moved, np.int64)}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: the state does not belong to these hypotheses, or is damaged.
        """
        saved = {name: np.asarray(arrays[f"memory_{name}"]) for name in self._memory._fields}
        for name, array in self._memory._asdict().items():
            if saved[name].shape != array.shape or not np.isfinite(saved[name]).all():
                raise ValueError(f"{name} of shape {saved[name].shape} does not fit, or is not finite")
        moved = np.asarray(arrays["moved"], np.int64)
        if moved.shape != (len(self.moved),):
            raise ValueError(f"moved of shape {moved.shape} does not fit")
        self.active_faults.from_array(np.asarray(arrays["standing"], float))
        self.moved = tuple(moved.tolist())
        self._build()
        self._memory = Memory(**{n: np.array(saved[n], a.dtype) for n, a in self._memory._asdict().items()})

    def run(self, samples: SampleBlock) -> list[Event]:
        """Run samples (N,) in the order of their receipt; returns the events.

        Samples with a NaN in ``shift``, or with ``gate`` False, are not tested.  If ``shift`` or ``weight`` is None or
        NaN, its last value is kept.

        Raises:
            ValueError: shapes that do not fit.
        """
        return self._run(_block(samples), samples.shift, _NO_TRACE)

    def run_traced(self, samples: SampleBlock, reference: bool = False) -> tuple[list[Event], BankTrace]:
        """As ``run``, with innovations, log-likelihood ratios and g at each sample, (N, len(hypotheses)) each.

        With ``reference`` the predictor of the present state is added as the first column.
        """
        first, last = 0 if reference else 1, len(self.hypotheses) + 1
        trace = BankTrace(*(np.full((samples.size, len(self._lanes)), np.nan) for _ in range(3)))
        events = self._run(_block(samples), samples.shift, trace)
        return events, BankTrace(*(values[:, first:last] for values in trace))

    def _run(self, block: Block, shift: Floats | None, trace: BankTrace) -> list[Event]:
        N, p = len(block.t), len(self.moved)
        if shift is None:
            return self._run_on(block, trace)
        if np.shape(shift) != (N, p):
            raise ValueError(f"shift of shape {np.shape(shift)}: need {(N, p)}")
        known = np.asarray(np.isfinite(shift).all(axis=1))[:, np.newaxis]
        block = block._replace(gate=np.asarray(block.gate & known) if len(block.gate) else known)
        events: list[Event] = []
        for rows, moved in steps(self.model, shift, self.moved, N):
            if moved != self.moved:
                self.follow(moved)
            part = Block(block.t[rows], block.u[rows], block.y[rows], block.gate[rows], block.weight[rows])
            events += self._run_on(part, BankTrace(*(values[rows] for values in trace)))
        return events

    def _run_on(self, block: Block, trace: BankTrace) -> list[Event]:
        """Run samples with the same nominal values."""
        done, events = 0, list[Event]()
        while done < len(block.t):
            done = run_hypotheses(self._lanes, self._tables, self._predictors, self._memory, block, done, trace)
            if self._memory.integers[kernel.WAIT, 0] == 0:
                events += self._decide(int(block.t[done - 1]))
        return events

    def _decide(self, now_us: int) -> Iterator[Event]:
        """Take the decision that is due: after a detection, in an identification, or to refine a named cause."""
        phase = self._memory.integers[kernel.PHASE, 0]
        if phase == kernel.REFINING:
            yield from self._settle(now_us)
            return
        if phase == kernel.CORRECTING and (share := self._more_of_latest()) is not None:
            yield from self._correct_size(now_us, share)
            return
        if phase in (kernel.WATCHING, kernel.CORRECTING):
            self._await_name(now_us)
            self._restart_changed_signs()
            found = self._evidence
            yield ChangeDetected(now_us, found.onset(), found.shares())
        yield from self._identify(now_us)

    def _identify(self, now_us: int) -> Iterator[Event]:
        """Name the cause if it is certain, or if the waiting time is over."""
        integers, found = self._memory.integers, self._evidence
        since = int(integers[kernel.SINCE, 0])
        integers[kernel.CHECKS, 0] += 1
        integers[kernel.WAIT, 0] = max(1, round(self.settings.memory / LOOKS))
        waited = integers[kernel.CHECKS, 0] / (LOOKS * MEMORIES)  # as a share of the waiting time
        if waited >= 1 and not found.lasts():
            self._start(0)
            yield CauseEnded(now_us, since, HEALTHY)
            return
        # Until the state has settled after the change, no hypothesis is right, and the least wrong one seems certain.
        early = now_us - since < self._slowest_us
        cause, probability = found.most_probable()
        sure, resort = probability >= SURE_ENOUGH, cause in self._last_resort
        if waited >= (PATIENCE if resort else 1) or (sure and not early and not resort):
            total = self.active_faults.with_total_sizes(found.shares())
            self._wait(kernel.REFINING, MEMORIES)
            self._memory.sums[SINCE_DETECTION] = 0.0  # what raised the alarm may not last
            yield CauseIdentified(now_us, since, found.onset(), total, sure, settled=False)

    def _restart_changed_signs(self) -> None:
        """Restart predictors with a changed sign from the reference: so far they have moved in the wrong direction."""
        for k, hypothesis in enumerate(self._hypotheses):
            if hypothesis.torque.scale < 0 or hypothesis.output.scale < 0:
                self._memory.x[:, k] = self._memory.x[:, 0]

    def _settle(self, now_us: int) -> Iterator[Event]:
        """Add the most likely cause, with its size, to the active faults; later changes are relative to them."""
        found, since = self._evidence, int(self._memory.integers[kernel.SINCE, 0])
        shares, onset = found.shares(), found.onset()
        best = shares[0]
        lane, lasts = found.lane(best.cause), found.lasts(best.cause)
        over = self.active_faults.ended(best) if lasts else [HEALTHY]
        if best.cause != HEALTHY and not over:
            total, sure = self.active_faults.with_total_sizes(shares), best.probability >= SURE_ENOUGH
            yield CauseIdentified(now_us, since, onset, total, sure)
            self.active_faults.join(best, self._hypotheses[lane])
        for cause in over:
            self.active_faults.end(cause)
            yield CauseEnded(now_us, since, cause)
        self._start(lane if lasts else 0)
        if self.active_faults and self.active_faults.latest.has_steps:
            self._wait(kernel.CORRECTING, CORRECTED_AFTER)

    def _more_of_latest(self) -> Share | None:
        """The error of the size of the latest fault; None: it has ended, or something else has changed."""
        found = self._evidence
        share = next(share for share in found.shares() if share.cause == self.active_faults.latest.cause)
        sized = found.likeliest() == share.cause and math.isfinite(share.size_sd)
        changed = found.has_crossed and (not sized or self.active_faults.ended(share))
        return None if changed else share

    def _correct_size(self, now_us: int, error: Share) -> Iterator[Event]:
        """Correct the size of the latest fault by its error; once more, if that was large enough to be detected.

        If nothing is left of it, it has ended.
        """
        found, since_us = self._evidence, int(self._memory.integers[kernel.SINCE, 0])
        crossed = found.has_crossed
        (total,) = self.active_faults.with_total_sizes((error,))
        ended = math.isfinite(total.size_sd) and self.active_faults.is_negligible(total)
        if ended:
            yield CauseEnded(now_us, since_us, total.cause)
            self.active_faults.end(total.cause)
        elif math.isfinite(total.size_sd):
            yield SizeCorrected(now_us, since_us, total)
            self.active_faults.join(error, self._hypotheses[found.lane(error.cause)])
        self._start(0)
        if crossed and not ended:
            self._wait(kernel.CORRECTING, CORRECTED_AFTER)

    @property
    def _evidence(self) -> BankEvidence:
        return BankEvidence(self._memory, self._predictors, self._hypotheses, self._causes, self._slowest_us)

    def _wait(self, phase: int, memories: int) -> None:
        """Stop the run this number of memory lengths from now, for the decision that ends the phase."""
        wait = round(memories * self.settings.memory)
        self._memory.integers[[kernel.PHASE, kernel.WAIT], 0] = phase, wait

    def _start(self, lane: int) -> None:
        """Restart with the present active faults, from the state of this lane."""
        M = self._memory
        self._build()
        M.x[:] = M.x[:, lane : lane + 1]
        M.sums[:], M.when[:] = 0.0, M.integers[kernel.LAST, 0]
        M.integers[[kernel.PHASE, kernel.WAIT, kernel.CHECKS], 0] = kernel.WATCHING, 1, 0
        last_us = M.integers[kernel.LAST, 0]
        if last_us != NEVER:
            M.integers[kernel.SETTLED, 0] = last_us + int(self._predictors.axis[SETTLES, 0])


def _copy(memory: Memory) -> Memory:
    return Memory(**{name: array.copy() for name, array in memory._asdict().items()})


def _block(samples: SampleBlock) -> Block:
    t_us, u, y, _, gate, weight = samples[:6]
    t = np.ascontiguousarray(t_us, dtype=np.int64)
    opened = _ALWAYS if gate is None else np.ascontiguousarray(gate, np.bool_)[:, np.newaxis]
    held = _AS_BEFORE if weight is None else np.ascontiguousarray(weight, float)
    if t.ndim != 1 or np.shape(u) != t.shape or np.shape(y) != t.shape or len(opened) not in {0, len(t)}:
        raise ValueError(f"t, u, y of shapes {t.shape}, {np.shape(u)}, {np.shape(y)}: need (N,) each")
    if held.shape not in {(0,), t.shape}:
        raise ValueError(f"weight of shape {held.shape}: need {t.shape}")
    return Block(t, np.ascontiguousarray(u, float), np.ascontiguousarray(y, float), opened, held)
