"""The predictors of the multi-model detector of one axis: samples in; detected, identified and ended changes out."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import Onset
from monitor_core.detection.multimodel.active_faults import ActiveFaults
from monitor_core.detection.multimodel.candidates import default_hypotheses
from monitor_core.detection.multimodel.hypothesis import HEALTHY, Hypothesis, moved_model, steps
from monitor_core.detection.multimodel.lanes import Tests, lanes_of, memory_of
from monitor_core.detection.multimodel.naming import (
    CauseEnded,
    CauseIdentified,
    CausePosterior,
    ChangeDetected,
    Event,
    Paths,
    Share,
)
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.kernel import hypotheses as kernel
from monitor_core.kernel.hypotheses import BankTrace, Block, Memory, run_hypotheses
from monitor_core.kernel.likelihood import FIRST_MARK, HELD_BACK, LATE, MARKS, ONSET, G
from monitor_core.kernel.predictors import LIMIT, SETTLES, Predictors
from monitor_core.kernel.state import NEVER, USED
from monitor_core.kernel.tables import Tables
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings

SURE_ENOUGH = 0.999
"""Share of the likeliest cause from which on it is named."""
MEMORIES = 3
"""Without such a share the likeliest causes are named after so many memory lengths."""
LOOKS = 20
"""Looks at the shares in each of them."""
PATIENCE = 2
"""So many times as long if it is nothing but noise, a signal that is another one or a scale that never changes: what no
size fits well looks like that, too, until there is more evidence."""
_NO_TRACE = BankTrace(*[np.empty((0, 0))] * 3)
_ALWAYS, _AS_BEFORE = np.empty((0, 1), np.bool_), np.empty(0)
"""In place of a gate, and of a weight"""
_REMEMBERED = 256
"""Steps whose predictors are kept, for nominal values that come again with the pose."""


class HypothesisBank:
    """Predictors of one axis, one for each hypothesis.

    When a cause has been identified, the bank restarts around the changed axis.  So it detects a second change, and the
    end of the first one.

    Args:
        model: nominal values; the causes are the monitored parameters and faults of the sensors.
        settings: predictor, gaps, lambda_0, memory.
        hypotheses: changes to detect; default ``candidates``.
        h: thresholds, one or (len(hypotheses),).
        allowance: subtracted from each log-likelihood ratio, for differences of healthy records; one or as many.
        sure: the probability from which on a cause is named.

    Raises:
        ValueError: thresholds that do not fit, a hypothesis that the drive cannot have, or a predictor that is not
            stable.
    """

    def __init__(
        self,
        model: AxisModel,
        settings: Settings,
        hypotheses: Sequence[Hypothesis] | None = None,
        h: float | Floats = math.inf,
        allowance: float | Floats = 0.0,
        sure: float = SURE_ENOUGH,
    ) -> None:
        self.model, self.settings, self.sure = model, settings, sure
        chosen = default_hypotheses(model, settings) if hypotheses is None else hypotheses
        self.standing = ActiveFaults(model, settings, chosen)
        """What has been named and is not over."""
        many = len(self.hypotheses)
        self.h, self.allowance = (np.broadcast_to(np.asarray(v, float), (many,)) for v in (h, allowance))
        """Threshold and allowance of each hypothesis (len(hypotheses),), each"""
        if many == 0 or not (self.h > 0).all() or not np.isfinite(self.allowance).all():
            raise ValueError(f"{many} hypotheses, h = {h}, allowance = {allowance}: need h > 0")
        errors = dict(zip(model.monitored, settings.model_errors(len(model.monitored)), strict=True))
        follows = np.array([errors.get(hypothesis.cause, 0.0) > 0 for hypothesis in self.hypotheses])
        self._tolerated: Floats = np.where(follows, self.allowance, 0.0)
        """Of the allowance, what is there as nominal values follow a model (len(hypotheses),).  It doubts whether
        anything has changed, and is largest for small changes.  Once something has, it speaks for no other cause."""
        self._last_resort = {hypothesis.cause for hypothesis in self.hypotheses if hypothesis.weight < 1}
        slowest_s = slowest_time_constant(model, settings.gain(len(model.drive.states)), settings.interval_s)
        if not math.isfinite(slowest_s):
            raise ValueError("the predictor is not stable: hypotheses need a filter gain K")
        self._slowest_us = round(1e6 * slowest_s)
        self.moved = (0,) * len(model.monitored)
        """By how many steps (hypothesis.py) nominal values are away from those of the model."""
        self._known: dict[tuple[int, ...], tuple[Tables, Predictors]] = {}
        self._build()
        self._lanes = np.arange(self._predictors.own.shape[1])
        self._memory = memory_of(self._tables, len(self._lanes))

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Hypotheses of the bank."""
        return self.standing.hypotheses

    @property
    def memory(self) -> Memory:
        """A copy of the state, for a bank of the same hypotheses around the same axis."""
        return _copy(self._memory)

    @memory.setter
    def memory(self, memory: Memory) -> None:
        self._memory = _copy(memory)

    def reset(self) -> None:
        """Return to the state before the first sample."""
        if self.standing:
            self.standing.clear()
            self._build()
        self.follow((0,) * len(self.moved))
        self._memory = memory_of(self._tables, len(self._lanes))

    def _build(self) -> None:
        """Build the lanes around the active faults."""
        self._hypotheses = self.standing.lanes()
        self._causes = CausePosterior(self._hypotheses[1:])
        back_h = float(np.median(self.h)) if self.standing else math.inf
        parts = (self.allowance, self._tolerated, self.standing.unexplained())
        self._tests = Tests(
            np.concatenate([[np.inf], self.h, [back_h]]), *(np.concatenate([[0.0], p, [0.0]]) for p in parts)
        )
        self._known.clear()
        self.follow(self.moved)

    def follow(self, moved: tuple[int, ...]) -> None:
        """Move the hypotheses to nominal values that have moved by these steps."""
        self.moved = moved
        if moved not in self._known:
            while len(self._known) >= _REMEMBERED:
                del self._known[next(iter(self._known))]
            moved_there = moved_model(self.model, moved)
            self._known[moved] = lanes_of(moved_there, self.settings, self._hypotheses, self._tests)
        self._tables, self._predictors = self._known[moved]

    def adopt(self, standing: Mapping[str, float], since_us: int | None) -> None:
        """Make exactly these causes active, with these sizes (NaN: it has none).

        ``since_us``: time at which a further change was detected; it is to be identified again, as its evidence is
        lost.
        """
        self.standing.adopt(standing)
        self._start(0)
        if since_us is not None:
            self._await_name(since_us)
            self._memory.integers[kernel.WAIT, 0] = max(1, round(self.settings.memory / LOOKS))

    def _await_name(self, since_us: int) -> None:
        """A change was detected at that time, and is to be identified."""
        integers = self._memory.integers
        integers[kernel.PHASE, 0] = kernel.PENDING
        integers[kernel.CHECKS, 0], integers[kernel.SINCE, 0] = 0, since_us

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that may be named."""
        return self.standing.causes

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
        """The whole state, to be saved: arrays by name."""
        named = {f"memory_{name}": array.copy() for name, array in self._memory._asdict().items()}
        return named | {"standing": self.standing.to_array(), "moved": np.array(self.moved, np.int64)}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: it does not belong to these hypotheses, or is damaged.
        """
        saved = {name: np.asarray(arrays[f"memory_{name}"]) for name in self._memory._fields}
        for name, array in self._memory._asdict().items():
            if saved[name].shape != array.shape or not np.isfinite(saved[name]).all():
                raise ValueError(f"{name} of shape {saved[name].shape} does not fit, or is not finite")
        moved = np.asarray(arrays.get("moved", self.moved), np.int64)
        if moved.shape != (len(self.moved),):
            raise ValueError(f"moved of shape {moved.shape} does not fit")
        self.standing.from_array(np.asarray(arrays["standing"], float))
        self.moved = tuple(moved.tolist())
        self._build()
        self._memory = Memory(**{n: np.array(saved[n], a.dtype) for n, a in self._memory._asdict().items()})

    def run(self, samples: SampleBlock) -> list[Event]:
        """Run samples (N,) in the order of their receipt.

        Nothing is tested where ``shift`` is NaN, or ``gate`` False.  Without ``shift`` and where it is NaN, its last
        value is kept; so it is with ``weight``.

        Raises:
            ValueError: shapes that do not fit.
        """
        return self._run(_block(samples), samples.shift, _NO_TRACE)

    def run_traced(self, samples: SampleBlock, what_holds: bool = False) -> tuple[list[Event], BankTrace]:
        """As ``run``, with innovations, log-likelihood ratios and g at every sample, (N, len(hypotheses)) each.

        With ``what_holds`` the first column is that of the present reference.
        """
        first, last = 0 if what_holds else 1, len(self.hypotheses) + 1
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
        at, events = 0, list[Event]()
        while at < len(block.t):
            at = run_hypotheses(self._lanes, self._tables, self._predictors, self._memory, block, at, trace)
            if self._memory.integers[kernel.WAIT, 0] == 0:
                events += self._decide(int(block.t[at - 1]))
        return events

    def _decide(self, now_us: int) -> Iterator[Event]:
        """Decide after a detection, when an identification is due, or when a named cause can be refined."""
        phase = self._memory.integers[kernel.PHASE, 0]
        if phase == kernel.REFINING:
            yield from self._settle(now_us)
            return
        if phase == kernel.WATCHING:
            self._await_name(now_us)
            self._turn_round()
            yield ChangeDetected(now_us, self.onset(), self._shares())
        yield from self._look(now_us)

    def _look(self, now_us: int) -> Iterator[Event]:
        """Name the cause if it is certain, or if it has been looked for long enough."""
        integers, memory = self._memory.integers, self.settings.memory
        integers[kernel.CHECKS, 0] += 1
        integers[kernel.WAIT, 0], since = max(1, round(memory / LOOKS)), int(integers[kernel.SINCE, 0])
        looked = integers[kernel.CHECKS, 0] / (LOOKS * MEMORIES)
        if looked >= 1 and not self._lasts():
            self._start(0)
            yield CauseEnded(now_us, since, HEALTHY)
            return
        # While the state is still that of before the change, none is right, and the least wrong one seems sure.
        early = now_us - since < self._slowest_us
        cause, probability = self._causes.likeliest(self._evidence)
        sure, resort = probability >= self.sure, cause in self._last_resort
        if looked >= (PATIENCE if resort else 1) or (sure and not early and not resort):
            integers[kernel.PHASE, 0], integers[kernel.WAIT, 0] = kernel.REFINING, round(MEMORIES * memory)
            yield CauseIdentified(now_us, since, self.onset(), self.standing.whole_of(self._shares()), sure)

    def _turn_round(self) -> None:
        """Predictors with a changed sign have moved the other way so far: they restart from the reference."""
        for k, hypothesis in enumerate(self._hypotheses):
            if hypothesis.torque.scale < 0 or hypothesis.output.scale < 0:
                self._memory.x[:, k] = self._memory.x[:, 0]

    def _lasts(self) -> bool:
        """Whether there is still evidence of a change."""
        many = len(self._hypotheses)
        return bool((self._memory.sums[G, :many] > 0.5 * self._predictors.own[LIMIT, :many]).any())

    def _settle(self, now_us: int) -> Iterator[Event]:
        """Add the most likely cause to the active faults, with its size; from now on changes are relative to that."""
        found, onset, since = self._shares(), self.onset(), int(self._memory.integers[kernel.SINCE, 0])
        best, lane = found[0], self._lane_of(found[0])
        over = self.standing.ended(best) if self._lasts() else [HEALTHY]
        if best.cause != HEALTHY and not over:
            yield CauseIdentified(
                now_us, since, onset, self.standing.whole_of(found), best.probability >= self.sure
            )
            self.standing.join(best, self._hypotheses[lane])
        for cause in over:
            self.standing.end(cause)
            yield CauseEnded(now_us, since, cause)
        self._start(lane if self._lasts() else 0)

    def _shares(self) -> tuple[Share, ...]:
        when = self._memory.when[[ONSET, LATE], 1 : len(self._hypotheses)]
        return self._causes.shares(self._evidence, Paths(*when))

    @property
    def _evidence(self) -> Floats:
        """Log-likelihood ratios (H,) since the onset."""
        g, held_back = self._memory.sums[[G, HELD_BACK], 1 : len(self._hypotheses)]
        return np.asarray(g + held_back)

    def onset(self) -> Onset:
        """Onset of the most likely hypothesis: when its g was last zero, with an interval.

        A hypothesis assumes that the change was always there, and gains no evidence while the state of the axis is
        still that of before.  So the change may be earlier by half the slowest time constant.
        """
        k = int(self._memory.sums[G, : len(self._hypotheses)].argmax())
        when = self._memory.when[:, k]
        best, earliest = int(when[ONSET]), int(when[FIRST_MARK + MARKS - 1]) - self._slowest_us // 2
        low = earliest if earliest > NEVER // 2 else None  # otherwise it lies before the first sample
        return Onset.within(best, low, max(int(when[LATE]), best))

    def _lane_of(self, best: Share) -> int:
        """The hypothesis of a cause with the most evidence."""
        evidence = self._memory.sums[[G, HELD_BACK]].sum(axis=0)
        own = [k for k, hypothesis in enumerate(self._hypotheses) if k > 0 and hypothesis.cause == best.cause]
        return max(own, key=lambda k: float(evidence[k]))

    def _start(self, lane: int) -> None:
        """Restart around the active faults, from the state of a hypothesis."""
        M = self._memory
        self._build()
        M.x[:] = M.x[:, lane : lane + 1]
        M.sums[:], M.when[:] = 0.0, M.integers[kernel.LAST, 0]
        M.integers[kernel.PHASE, 0], M.integers[kernel.WAIT, 0], M.integers[kernel.CHECKS, 0] = (
            kernel.WATCHING,
            1,
            0,
        )
        if M.integers[kernel.LAST, 0] != NEVER:
            M.integers[kernel.SETTLED, 0] = M.integers[kernel.LAST, 0] + int(
                self._predictors.axis[SETTLES, 0]
            )


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
