"""The monitors of all axes: axes of equal structure share a bank, one kernel call for each bank and block."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.bank import Bank
from monitor_core.episodes import Episode
from monitor_core.kernel.state import NEVER
from monitor_core.model import AxisModel
from monitor_core.monitor import AxisMonitor
from monitor_core.operating import Conditions, Operating
from monitor_core.settings import Settings
from service.axes import axis_model, axis_settings
from service.config import NamedAxis, conditions_of
from service.ingest.table_record import SampleBlock
from service.ingest.turns import AMBIGUOUS, Motion, Turns, turns_of

Samples = Mapping[str, SampleBlock]
"""Samples by axis, in the order of their times."""


class Change(NamedTuple):
    """An episode of an axis as it is now: raised, updated or ended."""

    axis_id: str
    episode: Episode


class Monitors:
    """The monitors of all axes.

    Raises:
        AxisError: an axis cannot be monitored as configured.
    """

    def __init__(self, axes: Sequence[NamedAxis]) -> None:
        self._banks = [_MonitorBank(group) for group in _groups(axes)]
        monitors = {axis_id: monitor for bank in self._banks for axis_id, monitor in bank.lanes}
        self.by_id: Mapping[str, AxisMonitor] = {axis.id: monitors[axis.id] for axis in axes}
        self._turns = {axis.id: turns for axis in axes if (turns := turns_of(axis.config)) is not None}
        self._resumed = False
        self._operating = {axis_id: one for bank in self._banks for axis_id, one in bank.operating.items()}

    def run(self, samples: Samples) -> list[Change]:
        """Let every axis take its samples; what changed, axis by axis in order of time."""
        whole = self._whole(samples) if self._turns else samples
        return [change for bank in self._banks for change in bank.run(whole)]

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
    def bank_sizes(self) -> list[int]:
        """How many axes share each bank."""
        return [len(bank.lanes) for bank in self._banks]

    def compile(self) -> None:
        """Have the kernel ready: compiled, or loaded from its cache."""
        self.run({})


class _Axis(NamedTuple):
    id: str
    model: AxisModel
    settings: Settings
    conditions: Conditions


class _MonitorBank:
    """A bank with the monitors of its lanes."""

    def __init__(self, axes: Sequence[_Axis]) -> None:
        self._bank = Bank([axis.model for axis in axes], [axis.settings for axis in axes])
        self.lanes = [(axis.id, AxisMonitor(self._bank, a)) for a, axis in enumerate(axes)]
        self.operating = {axis.id: Operating(axis.model, axis.conditions) for axis in axes if axis.conditions}

    def run(self, samples: Samples) -> Iterator[Change]:
        blocks = [samples.get(axis_id) for axis_id, _ in self.lanes]
        count = np.array([0 if block is None else len(block.t_us) for block in blocks])
        shape = (int(count.max()), len(blocks))
        t_us, u, y = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
        for a, block in enumerate(blocks):
            if block is not None:
                n = count[a]
                t_us[:n, a], u[:n, a], y[:n, a] = block.t_us, block.torque, block.motion
        shift, gate = self._conditions(blocks, count)
        for a, event in self._bank.run(t_us, u, y, count, shift, gate):
            axis_id, monitor = self.lanes[a]
            for episode in monitor.apply(event):
                yield Change(axis_id, episode)

    def _conditions(
        self, blocks: Sequence[SampleBlock | None], count: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64] | None, NDArray[np.bool_] | None]:
        """Shift (N, p, W) of the nominal values and gates (N, W), where any axis depends on something."""
        if not self.operating:
            return None, None
        N, W = int(count.max()), len(blocks)
        shift, gate = np.zeros((N, len(self._bank.models[0].monitored), W)), np.ones((N, W), np.bool_)
        for a, block in enumerate(blocks):
            operating = self.operating.get(self.lanes[a][0])
            if block is not None and operating is not None:
                n = count[a]
                shift[:n, :, a], gate[:n, a] = operating.take(block.t_us, block.motion, block.signals)
        return shift, gate


def _motion(monitor: AxisMonitor) -> Motion | None:
    """Where the predictor of an axis has it, at its last sample; None: there was none."""
    state, a = monitor.bank.state, monitor.axis
    if state.t[a] == NEVER:
        return None
    A, _, C = monitor.model.matrices()
    angle, speed = float(C[0] @ state.x[:, a]), float((C @ A)[0] @ state.x[:, a])
    return Motion(int(state.t[a]), angle, speed * 1e-6)


def _unwrapped(block: SampleBlock, turns: Turns) -> SampleBlock:
    angle, sure = turns.take(block.t_us, block.motion)
    signals = None if block.signals is None else block.signals[sure]
    return SampleBlock(block.t_us[sure], block.torque[sure], angle[sure], signals)


def _groups(axes: Sequence[NamedAxis]) -> list[list[_Axis]]:
    """Axes of equal drive and equal monitored parameters, each group in the order of the configuration."""
    groups: dict[object, list[_Axis]] = {}
    for axis in axes:
        model = axis_model(axis.config)
        found = groups.setdefault((model.drive, model.monitored), [])
        found.append(_Axis(axis.id, model, axis_settings(axis, model), conditions_of(axis)))
    return list(groups.values())
