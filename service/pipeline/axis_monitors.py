"""Monitors of all configured axes: samples by axis in, changed alarms out; and from the frames of all buses to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from itertools import groupby
from typing import Any, NamedTuple

from monitor_core.detection import MultiModelDetector
from monitor_core.drive import Operating
from monitor_core.monitoring import (
    NEVER,
    AxisMonitor,
    AxisTrace,
    CalibratedRange,
    ConditionTracker,
    Fleet,
    Range,
    WarmUp,
)
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings
from monitor_core.wording import joined, sentence
from service.can.frames import FrameBlock
from service.config import Config, NamedAxis, conditions_of
from service.config.axis_settings import axis_settings, detectors_of, monitored_model
from service.ingest.bus_samples import Ingest
from service.ingest.unwrap import AMBIGUOUS, Motion, turns_of
from service.pipeline.alarm_recording import AxisAlarm
from service.pipeline.epoch_progress import EpochProgress
from service.pipeline.live_signals import LiveSignals
from service.pipeline.trends import Trends

Samples = Mapping[str, SampleBlock]
"""Samples by axis, in the order of their times."""

Observer = Callable[[str, SampleBlock, AxisTrace], None]
"""Gets the samples of each axis, and what was computed at each of them."""


_BLOCKS_AT_ONCE = 8
"""For a multi-model detector; after the start those of some seconds may wait for the compiler."""


class Heat(NamedTuple):
    """How warm an axis is, as the friction power that would keep it so, and its standard deviation [W]."""

    heat_w: float
    sd_w: float
    known: bool
    """Well enough to test its friction"""


class AxisMonitors:
    """The monitors of all axes.

    Raises:
        AxisError: an axis cannot be monitored as configured.
    """

    def __init__(self, axes: Sequence[NamedAxis]) -> None:
        self._ids = [axis.id for axis in axes]
        self.epochs = {axis.id: EpochProgress(axis.epoch, axis.configured) for axis in axes}
        """The epoch of each axis, and what is under way"""
        models = [monitored_model(axis) for axis in axes]
        settings = [axis_settings(axis, m) for axis, m in zip(axes, models, strict=True)]
        detectors = [detectors_of(*each) for each in zip(axes, models, settings, strict=True)]
        multimodel = {a: d.multimodel for a, d in enumerate(detectors) if d.multimodel is not None}
        sources = {a: d.alarm_source for a, d in enumerate(detectors)}
        self._fleet = Fleet(models, settings, multimodel, sources) if axes else Fleet.of_monitors(())
        self.by_id: Mapping[str, AxisMonitor] = dict(zip(self._ids, self._fleet.monitors, strict=True))
        self._deferred: dict[str, list[SampleBlock]] | None = None
        """Samples that wait for the multi-model detectors, by axis; None: they take them at once"""
        self._turns = {axis.id: turns for axis in axes if (turns := turns_of(axis.config)) is not None}
        keys = [
            self.epochs[axis.id].key(monitor.history_key)
            for axis, monitor in zip(axes, self._fleet.monitors, strict=True)
        ]
        self.trends = Trends(axes, models, keys)
        """The long-term trends of all axes"""
        self._resumed = False
        conditions = [(axis.id, m, conditions_of(axis)) for axis, m in zip(axes, models, strict=True)]
        self._operating = {axis_id: Operating(m, c) for axis_id, m, c in conditions if c}
        self._warm_ups = {
            axis_id: WarmUp(operating, self.by_id[axis_id])
            for axis_id, operating in self._operating.items()
            if operating.thermal is not None
        }
        self._calibrated = {
            axis.id: _calibrated_range(axis, s, c.columns)
            for axis, s, (_, _, c) in zip(axes, settings, conditions, strict=True)
            if axis.config.model.thresholds_file is not None and axis.config.model.thresholds_file.range
        }
        self._waiting, self._widening = (
            {axis.id for axis in axes if axis.config.detector.outside_calibration == way}
            for way in ("wait", "widen")
        )

    def update(self, samples: Samples, observer: Observer | None = None) -> list[AxisAlarm]:
        """Let every axis take its samples; returns the alarms that changed, axis by axis."""
        rest: Samples = self._unwrapped(samples) if self._turns else samples
        changed, begun = list[AxisAlarm](), False
        while rest or not begun:
            parts = {a: self._part(a, rest[a]) for a in self._ids if a in rest}
            changed += self._update({a: part for a, (part, _) in parts.items()}, observer)
            rest, begun = {a: more for a, (_, more) in parts.items() if more is not None}, True
        return changed

    def _update(self, samples: Samples, observer: Observer | None) -> list[AxisAlarm]:
        blocks = {a: samples[i] for a, i in enumerate(self._ids) if i in samples}
        changed: list[AxisAlarm] = []
        together = self._deferred is None
        for a, update in self._fleet.update(blocks, traced=observer is not None, multimodel=together).items():
            axis_id, monitor = self._ids[a], self._fleet.monitors[a]
            if self._deferred is not None and monitor.multimodel is not None:
                self._deferred.setdefault(axis_id, []).append(monitor.judged(blocks[a]))
            self.trends.take(axis_id, update.readings)
            self.epochs[axis_id].take(update.readings)
            if observer is not None and update.trace is not None:
                observer(axis_id, blocks[a], update.trace)
            changed += [AxisAlarm(axis_id, change.alarm) for change in update.changes]
        return changed

    def defer_multimodel(self) -> None:
        """Let the samples wait for the multi-model detectors from now on, each time until ``update_multimodel``."""
        self._deferred = {}

    def update_multimodel(self) -> list[AxisAlarm]:
        """Let the multi-model detectors take the samples that waited, in order; returns the alarms that changed."""
        deferred, self._deferred = self._deferred or {}, {}
        return [
            AxisAlarm(axis_id, change.alarm)
            for axis_id, blocks in deferred.items()
            for _, alike in groupby(enumerate(blocks), _alike)
            for change in self.by_id[axis_id].update_multimodel(concatenate([block for _, block in alike]))
        ]

    def change(self, axis_ids: Sequence[str], made: AxisMonitors) -> None:
        """Monitor these axes from now on: those of ``made`` by its monitors, the others go on as they are.

        ``made`` must not be used afterwards.
        """
        replaced = made.by_id.keys()
        by_id = {**self.by_id, **made.by_id}
        fleet = Fleet.of_monitors([by_id[a] for a in axis_ids])
        self._ids, self._fleet = list(axis_ids), fleet
        self.by_id = {a: by_id[a] for a in axis_ids}
        for own, new in (
            (self._turns, made._turns),
            (self._operating, made._operating),
            (self._warm_ups, made._warm_ups),
            (self._calibrated, made._calibrated),
            (self.epochs, made.epochs),
        ):
            _change(own, new, axis_ids, replaced)
        self.trends.change(axis_ids, made.trends)
        self._waiting = (self._waiting - replaced | made._waiting) & set(axis_ids)
        self._widening = (self._widening - replaced | made._widening) & set(axis_ids)
        if self._deferred is not None:
            self._deferred = {
                a: d for a, d in self._deferred.items() if a in self.by_id and a not in replaced
            }

    @property
    def deferred_samples(self) -> int:
        """Number of samples that wait for a multi-model detector."""
        return sum(block.size for blocks in (self._deferred or {}).values() for block in blocks)

    def _part(self, axis_id: str, block: SampleBlock) -> tuple[SampleBlock, SampleBlock | None]:
        """The first samples, with the nominal values and the gate that their conditions require; and the others."""
        operating, calibrated = self._operating.get(axis_id), self._calibrated.get(axis_id)
        more: SampleBlock | None = None
        if axis_id in self._warm_ups:
            block, more = self._warm_ups[axis_id].part(block)
        elif operating is not None:
            block = operating.conditioned(block)
        if calibrated is not None:
            inside = calibrated.take(block)
            block = block._replace(inside=inside)
            if axis_id in self._waiting:
                block = block._replace(gate=inside if block.gate is None else block.gate & inside)
        return block, more

    @property
    def begun_again(self) -> tuple[str, ...]:
        """Messages about learning windows that run, of which nothing could be restored."""
        running = (epoch.learning for epoch in self.epochs.values())
        return tuple(learning.again for learning in running if learning is not None and learning.again)

    def operating(self, axis_id: str) -> Operating | None:
        """The operating conditions of an axis; None: it has none."""
        return self._operating.get(axis_id)

    def heat(self, axis_id: str) -> Heat | None:
        """How warm an axis is; None: it has no thermal model."""
        operating = self._operating.get(axis_id)
        thermal = None if operating is None else operating.thermal
        return None if thermal is None else Heat(thermal.heat, thermal.sd, thermal.known)

    def outside_calibration(self, axis_id: str) -> tuple[str, ...]:
        """Conditions of the last sample of an axis that are outside the range of its calibration, in words."""
        calibrated, warm_up = self._calibrated.get(axis_id), self._warm_ups.get(axis_id)
        outside = () if calibrated is None else calibrated.outside
        if axis_id in self._widening and warm_up is not None and warm_up.widened:
            wider = sentence("wider", "{why}: tested with a wider allowance", why=warm_up.widened)
            return (*outside, wider)
        return outside

    def dropped(self, axis_id: str) -> Mapping[str, int]:
        """Samples of an axis that were refused before its monitor, by reason."""
        turns = self._turns.get(axis_id)
        return {} if turns is None else {AMBIGUOUS: turns.refused}

    def _unwrapped(self, samples: Samples) -> Samples:
        """The samples with continuous angles, where those of an axis wrap after each turn."""
        if samples and not self._resumed:  # a saved state has been restored by now
            self._resumed = True
            for axis_id, turns in self._turns.items():
                if (motion := _motion(self.by_id[axis_id])) is not None:
                    turns.resume(motion)
        return {
            axis_id: self._turns[axis_id].unwrapped(block) if axis_id in self._turns else block
            for axis_id, block in samples.items()
        }

    def waits_for(self, axis_id: str) -> str:
        """The operating condition by which the last sample of an axis was not used; empty: it was used."""
        operating = self._operating.get(axis_id)
        reason = operating.reason if operating else ""
        outside = self.outside_calibration(axis_id) if axis_id in self._waiting else ()
        return reason or joined(outside)

    @property
    def batch_sizes(self) -> list[int]:
        """How many axes share each batch."""
        return self._fleet.batch_sizes

    @property
    def multimodel(self) -> list[MultiModelDetector]:
        """The multi-model detectors that run."""
        return [m.multimodel for m in self.by_id.values() if m.multimodel is not None]

    def compile(self) -> None:
        """Compile the kernel of the estimates, or load it from its cache."""
        self.update({})

    def compile_multimodel(self) -> None:
        """Compile the kernel of the multi-model detectors if one runs, or load it from its cache."""
        for detector in self.multimodel[:1]:
            detector.bank.run(concatenate([]))


def _alike(at: tuple[int, SampleBlock]) -> tuple[object, ...]:
    """What numbered blocks share that can be taken at once: their arrays, and not too long a time.

    An alarm that is raised and ends within one block would only be seen to end.
    """
    number, block = at
    return number // _BLOCKS_AT_ONCE, *(values is None for values in block)


def _change(own: dict[str, Any], new: Mapping[str, Any], axis_ids: Sequence[str], replaced: Set[str]) -> None:
    """Let a table by axis have the entries of replaced axes, and none of axes that are gone."""
    for axis_id in [a for a in own if a in replaced or a not in axis_ids]:
        del own[axis_id]
    own.update(new)


def _calibrated_range(axis: NamedAxis, settings: Settings, signals: Sequence[str]) -> CalibratedRange:
    found = axis.config.model.thresholds_file
    known = () if found is None else tuple(Range(r.condition, r.low, r.high) for r in found.range)
    return CalibratedRange(known, ConditionTracker(axis.config.output, settings, signals))


def _motion(monitor: AxisMonitor) -> Motion | None:
    """Motion of the predictor of an axis at its last sample; None: there was none."""
    state, lane = monitor.batch.state, monitor.lane
    if state.t[lane] == NEVER:
        return None
    A, _, C = monitor.model.matrices()
    angle, speed = float(C[0] @ state.x[:, lane]), float((C @ A)[0] @ state.x[:, lane])
    return Motion(int(state.t[lane]), angle, speed * 1e-6)


# --- From frames to changed alarms: without clock, thread or file -----------------------------------------------------


class FramePipeline:
    """Ingest of every bus and the monitors of every axis.

    ``axes``: those of the configuration with the nominal values of their epochs, where these differ.

    Raises:
        AxisError: an axis cannot be monitored as configured.
        DescriptionError, IngestError: a bus cannot be decoded as configured.
    """

    def __init__(self, config: Config, axes: Sequence[NamedAxis] | None = None) -> None:
        self.monitors = AxisMonitors(config.axes if axes is None else axes)
        self.ingests = {bus.name: Ingest(config, bus.name) for bus in config.bus}
        self.live = LiveSignals()
        """What is shown of the last seconds"""
        self._samples: dict[str, list[SampleBlock]] = {}

    def take(self, bus: str, frames: FrameBlock) -> None:
        """Take frames of a bus, in the order of their receipt; their samples wait for ``update``."""
        self._keep(self.ingests[bus].feed(frames))

    def update(self) -> list[AxisAlarm]:
        """Pass all waiting samples to the monitors; returns the alarms that changed."""
        waiting, self._samples = self._samples, {}
        if not waiting:
            return []
        samples = {axis_id: concatenate(blocks) for axis_id, blocks in waiting.items()}
        return self.monitors.update(samples, self.live.observer())

    def flush(self) -> None:
        """End of the frames: values without a partner are counted; the last samples wait for ``update``."""
        for ingest in self.ingests.values():
            self._keep(ingest.flush())

    def change_buses(self, names: Sequence[str], new: Mapping[str, Ingest]) -> None:
        """Take frames of these buses from now on: those of ``new`` by it, of which no frame is left to be taken."""
        for name, ingest in self.ingests.items():
            if name in new or name not in names:
                self._keep(ingest.flush())
        self.ingests = {name: new.get(name) or self.ingests[name] for name in names}

    def _keep(self, samples: Samples) -> None:
        for axis_id, found in samples.items():
            self._samples.setdefault(axis_id, []).append(found)
