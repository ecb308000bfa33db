"""The monitors of all axes: axes of equal structure share a bank, one kernel call for each bank and block."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.bank import Bank
from monitor_core.episodes import Episode
from monitor_core.model import AxisModel
from monitor_core.monitor import AxisMonitor
from monitor_core.settings import Settings
from service.axes import axis_model, axis_settings
from service.config import NamedAxis

Block = tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]
"""Samples of an axis in the order of their times [us]: times, torque [N m], motion [rad or rad/s]."""

Samples = Mapping[str, Block]
"""Samples by axis."""


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

    def run(self, samples: Samples) -> list[Change]:
        """Let every axis take its samples; what changed, axis by axis in order of time."""
        return [change for bank in self._banks for change in bank.run(samples)]

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


class _MonitorBank:
    """A bank with the monitors of its lanes."""

    def __init__(self, axes: Sequence[_Axis]) -> None:
        self._bank = Bank([axis.model for axis in axes], [axis.settings for axis in axes])
        self.lanes = [(axis.id, AxisMonitor(self._bank, a)) for a, axis in enumerate(axes)]

    def run(self, samples: Samples) -> Iterator[Change]:
        blocks = [samples.get(axis_id) for axis_id, _ in self.lanes]
        count = np.array([0 if block is None else len(block[0]) for block in blocks])
        shape = (int(count.max()), len(blocks))
        t_us, u, y = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
        for a, block in enumerate(blocks):
            if block is not None:
                t_us[: count[a], a], u[: count[a], a], y[: count[a], a] = block
        for a, event in self._bank.run(t_us, u, y, count):
            axis_id, monitor = self.lanes[a]
            for episode in monitor.apply(event):
                yield Change(axis_id, episode)


def _groups(axes: Sequence[NamedAxis]) -> list[list[_Axis]]:
    """Axes of equal drive and equal monitored parameters, each group in the order of the configuration."""
    groups: dict[object, list[_Axis]] = {}
    for axis in axes:
        model = axis_model(axis.config)
        found = groups.setdefault((model.drive, model.monitored), [])
        found.append(_Axis(axis.id, model, axis_settings(axis, model)))
    return list(groups.values())
