"""The monitors of all axes: samples by the names of their axes into the fleet, its events into episodes."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.detection.alarm import Alarm, Crossing
from monitor_core.drive.operating_conditions import Operating
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.kernel.state import NEVER
from monitor_core.monitoring.axis_monitor import AnyEvent, AxisMonitor
from monitor_core.monitoring.fleet import Block, Fleet
from monitor_core.trend.entries import Reading
from service.config import NamedAxis, conditions_of
from service.config.axis_settings import axis_model, axis_settings
from service.config.detector_choice import detectors_of
from service.ingest.table_record import SampleBlock
from service.ingest.unwrap import AMBIGUOUS, Motion, Turns, turns_of
from service.pipeline.axis_change import Change
from service.pipeline.trend_tracking import Trends
from service.pipeline.warming import HYPOTHESES

Samples = Mapping[str, SampleBlock]
"""Samples by axis, in the order of their times."""


class Look(NamedTuple):
    """Samples of an axis, and what became of them."""

    block: Block
    trace: Trace
    """What the recursion did at each"""
    crossings: Sequence[Crossing]
    """Which of them crossed a threshold"""
    beside: BankTrace | None
    """What the bank of hypotheses did at each, if there is one"""


Onlooker = Callable[[str, Look], None]
"""Is told, by axis, of all samples."""


class Monitors:
    """The monitors of all axes.

    Raises:
        AxisError: an axis cannot be monitored as configured.
    """

    def __init__(self, axes: Sequence[NamedAxis]) -> None:
        self._ids = [axis.id for axis in axes]
        models = [axis_model(axis.config) for axis in axes]
        settings = [axis_settings(axis, m) for axis, m in zip(axes, models, strict=True)]
        found = [detectors_of(*each) for each in zip(axes, models, settings, strict=True)]
        beside = {a: one.beside for a, one in enumerate(found) if one.beside is not None}
        self._fleet = Fleet(models, settings, beside, {a: one.alarms for a, one in enumerate(found)})
        self.by_id: Mapping[str, AxisMonitor] = dict(zip(self._ids, self._fleet.monitors, strict=True))
        self._turns = {axis.id: turns for axis in axes if (turns := turns_of(axis.config)) is not None}
        keys = [monitor.history_key for monitor in self._fleet.monitors]
        self.trends = Trends(axes, models, keys)
        """The slow courses of all axes"""
        self._resumed = False
        conditions = [(axis.id, m, conditions_of(axis)) for axis, m in zip(axes, models, strict=True)]
        self._operating = {axis_id: Operating(m, c) for axis_id, m, c in conditions if c}

    def run(self, samples: Samples, onlooker: Onlooker | None = None) -> list[Change]:
        """Let every axis take its samples; what changed, axis by axis in order of time."""
        whole = self._whole(samples) if self._turns else samples
        blocks = {a: self._block(i, whole[i]) for a, i in enumerate(self._ids) if i in whole}
        return [
            Change(self._ids[a], episode)
            for a, event in self._run(blocks, onlooker)
            for episode in self._take(a, event)
        ]

    def _take(self, a: int, event: AnyEvent) -> Sequence[Alarm]:
        if isinstance(event, Reading):
            self.trends.take(self._ids[a], event)
            return ()
        return self._fleet.monitors[a].apply(event)

    def _run(self, blocks: Mapping[int, Block], onlooker: Onlooker | None) -> list[tuple[int, AnyEvent]]:
        if onlooker is None:
            return self._fleet.run(blocks)
        traces: dict[int, Trace] = {}
        beside: dict[int, BankTrace] = {}
        events = self._fleet.run(blocks, traces.__setitem__, beside.__setitem__)
        for a, trace in traces.items():
            crossings = [event for b, event in events if b == a and isinstance(event, Crossing)]
            onlooker(self._ids[a], Look(blocks[a], trace, crossings, beside.get(a)))
        return events

    def _block(self, axis_id: str, block: SampleBlock) -> Block:
        """Samples with the nominal values and the gate that their operating conditions ask for."""
        operating = self._operating.get(axis_id)
        if operating is None:
            return Block(block.t_us, block.torque, block.motion)
        shift, gate = operating.take(block.t_us, block.motion, block.signals)
        return Block(block.t_us, block.torque, block.motion, shift, gate)

    def dropped(self, axis_id: str) -> Mapping[str, int]:
        """Samples of an axis that were refused before its monitor saw them, by reason."""
        turns = self._turns.get(axis_id)
        return {} if turns is None else {AMBIGUOUS: turns.refused}

    def _whole(self, samples: Samples) -> Samples:
        """The samples with whole angles, where those of an axis start again after each turn."""
        if samples and not self._resumed:  # by now a saved state has been put back, if there is one
            self._resumed = True
            for axis_id, turns in self._turns.items():
                if (motion := _motion(self.by_id[axis_id])) is not None:
                    turns.resume(motion)
        return {
            axis_id: _unwrapped(block, self._turns[axis_id]) if axis_id in self._turns else block
            for axis_id, block in samples.items()
        }

    def waits_for(self, axis_id: str) -> str:
        """Why the last sample of an axis was not learned from, by its operating conditions; empty: nothing is."""
        operating = self._operating.get(axis_id)
        return operating.reason if operating else ""

    @property
    def shapes(self) -> list[int]:
        """Of the kernel that is needed: how many axes share each bank, and whether there are hypotheses."""
        hypotheses = any(monitor.beside is not None for monitor in self.by_id.values())
        return [*self._fleet.bank_sizes, *([HYPOTHESES] if hypotheses else [])]

    def compile(self) -> None:
        """Have the kernel ready: compiled, or loaded from its cache."""
        self.run({})
        nothing = np.zeros(0)
        for beside in [m.beside for m in self.by_id.values() if m.beside is not None][:1]:
            beside.run(np.zeros(0, np.int64), nothing, nothing)


def _motion(monitor: AxisMonitor) -> Motion | None:
    """Where the predictor of an axis has it, at its last sample; None: there was none."""
    state, a = monitor.batch.state, monitor.lane
    if state.t[a] == NEVER:
        return None
    A, _, C = monitor.model.matrices()
    angle, speed = float(C[0] @ state.x[:, a]), float((C @ A)[0] @ state.x[:, a])
    return Motion(int(state.t[a]), angle, speed * 1e-6)


def _unwrapped(block: SampleBlock, turns: Turns) -> SampleBlock:
    angle, sure = turns.take(block.t_us, block.motion)
    signals = None if block.signals is None else block.signals[sure]
    return SampleBlock(block.t_us[sure], block.torque[sure], angle[sure], signals)
