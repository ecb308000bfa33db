"""A fleet: axes with any drives, sample rates and settings, updated with their blocks of samples in one call."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor_core.detection.alarm import DetectorName
from monitor_core.detection.cusum.cusum_evidence import BatchEvent, Crossing
from monitor_core.detection.multimodel.multimodel_detector import MultiModelDetector
from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.monitoring.alarm_tracker import AlarmChange
from monitor_core.monitoring.axis_batch import AxisBatch, MoreColumns
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.trend.entries import EstimateReading

_T = TypeVar("_T", bound=np.generic)
_NO_AXIS = -1
"""In place of the index of an axis, for a lane that takes no samples"""
_NOTHING: Mapping[int, Any] = MappingProxyType({})


class AxisTrace(NamedTuple):
    """Values of an axis at each sample of a block."""

    estimator: Trace
    """Values of the recursion, without the dimension of the axes"""
    crossings: Sequence[Crossing]
    """The samples at which g crossed h"""
    multimodel: BankTrace | None
    """Values of the multi-model detector, if it runs"""


class AxisUpdate(NamedTuple):
    """Results of a block of samples of an axis."""

    changes: Sequence[AlarmChange]
    readings: Sequence[EstimateReading]
    """Readings for the long-term trend"""
    trace: AxisTrace | None
    """None: not requested"""


class Fleet:
    """Monitors of axes; those with equal drives and monitored parameters share a batch, and so the kernel's lanes.

    ``monitors`` are in the order of the models.  ``multimodel``: the multi-model detectors of the axes that have one,
    by axis.  ``alarm_sources``: the detector that raises the alarms, by axis; default: the CUSUM tests.

    Raises:
        ValueError: models and settings of different number, none, or settings that do not fit the drive.
    """

    def __init__(
        self,
        models: Sequence[AxisModel],
        settings: Sequence[Settings],
        multimodel: Mapping[int, MultiModelDetector] = _NOTHING,
        alarm_sources: Mapping[int, DetectorName] = _NOTHING,
    ) -> None:
        if not models or len(models) != len(settings):
            raise ValueError(f"{len(models)} models and {len(settings)} settings: need one each, at least one")
        self._groups = [
            _Group(axes, AxisBatch([models[a] for a in axes], [settings[a] for a in axes]))
            for axes in _groups(models, settings)
        ]
        lanes = {axis: (group.batch, lane) for group in self._groups for lane, axis in enumerate(group.axes)}
        self.monitors = tuple(
            AxisMonitor.of_lane(*lanes[axis], multimodel.get(axis), alarm_sources.get(axis, "cusum"))
            for axis in range(len(models))
        )

    @classmethod
    def of_monitors(cls, monitors: Sequence[AxisMonitor]) -> Fleet:
        """A fleet of existing monitors, which keep their states; they may come from several fleets.

        Lanes of monitors that are not in the new fleet take no more samples.
        """
        fleet = cls.__new__(cls)
        lanes: dict[int, _Group] = {}
        for axis, monitor in enumerate(monitors):
            empty = _Group([_NO_AXIS] * len(monitor.batch.models), monitor.batch)
            lanes.setdefault(id(monitor.batch), empty).axes[monitor.lane] = axis
        fleet._groups, fleet.monitors = list(lanes.values()), tuple(monitors)
        return fleet

    @property
    def batch_sizes(self) -> list[int]:
        """Number of lanes of each batch."""
        return [len(group.axes) for group in self._groups]

    def update(
        self, blocks: Mapping[int, SampleBlock], traced: bool = False, multimodel: bool = True
    ) -> dict[int, AxisUpdate]:
        """Update axes with their blocks, which may differ in length; an axis without a block takes no sample.

        The results of each axis are exactly those of the axis alone.  A trace takes memory for each sample: use short
        blocks.  With ``multimodel=False`` the multi-model detectors take no samples; pass the same blocks to
        ``AxisMonitor.update_multimodel`` later, for the same alarms.

        Returns the results by axis, for each axis with a block.

        Raises:
            ValueError: an axis does not exist, or arrays do not fit; then no axis has taken a sample.
        """
        unknown = sorted(set(blocks) - set(range(len(self.monitors))))
        if unknown:
            raise ValueError(f"blocks for the axes {unknown}: there are {len(self.monitors)}, from 0 on")
        for axis, block in blocks.items():
            _check(axis, block, self.monitors[axis].model)
        updates: dict[int, AxisUpdate] = {}
        for group in self._groups:
            for axis, (events, trace) in group.run(blocks, traced).items():
                updates[axis] = _axis_update(self.monitors[axis], blocks[axis], events, trace, multimodel)
        return {axis: updates[axis] for axis in sorted(updates)}


class _Group(NamedTuple):
    """A batch and the axes of its lanes."""

    axes: list[int]
    batch: AxisBatch

    def run(self, blocks: Mapping[int, SampleBlock], traced: bool) -> dict[int, tuple[list[BatchEvent], Trace | None]]:
        """Events of each axis with a block, and its trace if ``traced``."""
        taken = {lane: blocks[axis] for lane, axis in enumerate(self.axes) if axis in blocks}
        count = np.array([len(taken[a].t_us) if a in taken else 0 for a in range(len(self.axes))])
        shape = int(count.max()), len(self.axes)
        t_us, u, y = np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape)
        for lane, block in taken.items():
            n = count[lane]
            t_us[:n, lane], u[:n, lane], y[:n, lane] = block.t_us, block.u, block.y
        before = self.batch.state.shift
        shift = _filled("shift", taken, lambda: np.repeat(before[np.newaxis], shape[0], axis=0))
        gate = _filled("gate", taken, lambda: np.ones(shape, np.bool_))
        weight = _filled("weight", taken, lambda: np.full(shape, math.nan))
        more, trace = MoreColumns(count=count, shift=shift, gate=gate, weight=weight), None
        if traced:
            events, trace = self.batch.run_traced(t_us, u, y, **more)
        else:
            events = self.batch.run(t_us, u, y, **more)
        by_lane: dict[int, list[BatchEvent]] = {lane: [] for lane in taken}
        for lane, event in events:
            by_lane[lane].append(event)
        return {
            self.axes[lane]: (own, trace and Trace(*(field[: count[lane], ..., lane] for field in trace)))
            for lane, own in by_lane.items()
        }


def _axis_update(
    monitor: AxisMonitor,
    block: SampleBlock,
    events: Sequence[BatchEvent],
    trace: Trace | None,
    multimodel: bool,
) -> AxisUpdate:
    readings = [event for event in events if isinstance(event, EstimateReading)]
    if trace is None:
        found = monitor.multimodel_events(block) if multimodel else ()
        return AxisUpdate(monitor.apply(events, found, block), readings, None)
    found, bank_trace = monitor.multimodel_events_traced(block) if multimodel else ((), None)
    crossings = [event for event in events if isinstance(event, Crossing)]
    traces = AxisTrace(trace, crossings, bank_trace)
    return AxisUpdate(monitor.apply(events, found, block), readings, traces)


def _filled(name: str, blocks: Mapping[int, SampleBlock], empty: Callable[[], NDArray[_T]]) -> NDArray[_T] | None:
    """Array ``name`` of all blocks (N, ..., W), with default values for lanes that lack it; None if all lack it."""
    given = {lane: values for lane, block in blocks.items() if (values := getattr(block, name)) is not None}
    if not given:
        return None
    out = empty()
    for lane, values in given.items():
        out[: len(values), ..., lane] = values
    return out


def _groups(models: Sequence[AxisModel], settings: Sequence[Settings]) -> list[list[int]]:
    """Groups of axes that can share a batch; each group is in the order of the axes."""
    groups: dict[object, list[int]] = {}
    for axis, (model, s) in enumerate(zip(models, settings, strict=True)):
        groups.setdefault((model.drive, model.monitored, s.run_on), []).append(axis)
    return list(groups.values())


def _check(axis: int, block: SampleBlock, model: AxisModel) -> None:
    N, p = len(block.t_us), len(model.monitored)
    shapes = (N,), (N,), (N,), (N, p), (N,), (N,)
    for name, values, wanted in zip(block._fields[:6], block[:6], shapes, strict=True):
        if values is not None and np.shape(values) != wanted:
            raise ValueError(f"axis {axis}: {name} has the shape {np.shape(values)}: need {wanted}")
