"""Monitors of all axes: from samples to changed alarms, and from the frames of all buses to samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby

from monitor_core.detection import MultiModelDetector
from monitor_core.monitoring import AxisMonitor, AxisTrace, Fleet
from monitor_core.samples import SampleBlock, concatenate
from service.can.frames import FrameBlock
from service.config import Config, NamedAxis
from service.config.axis_detectors import detectors_of
from service.config.axis_settings import axis_settings, monitored_model
from service.ingest.samples.bus_samples import Ingest
from service.pipeline.axes.axis_alarms import AxisAlarm
from service.pipeline.axes.axis_pipeline import AxisPipeline
from service.pipeline.axes.live_signals import LiveSignals
from service.pipeline.axes.trends import Trends

Samples = Mapping[str, SampleBlock]
"""Samples by axis, in the order of their times."""

Observer = Callable[[str, SampleBlock, AxisTrace], None]
"""Called for each axis with its samples and with what the kernel computed at each of them."""


_BLOCKS_AT_ONCE = 8
"""Most blocks that a multi-model detector takes in one call.  After the start, blocks of some seconds may have waited
for the compiler."""


class AxisMonitors:
    """The monitors of all axes.

    Raises:
        AxisError: an axis cannot be monitored as configured.
    """

    def __init__(self, axes: Sequence[NamedAxis]) -> None:
        models = [monitored_model(axis) for axis in axes]
        settings = [axis_settings(axis, m) for axis, m in zip(axes, models, strict=True)]
        detectors = [detectors_of(*each) for each in zip(axes, models, settings, strict=True)]
        multimodel = {a: d.multimodel for a, d in enumerate(detectors) if d.multimodel is not None}
        sources = {a: d.alarm_source for a, d in enumerate(detectors)}
        self._fleet = Fleet(models, settings, multimodel, sources) if axes else Fleet.of_monitors(())
        self.axes: Mapping[str, AxisPipeline] = {
            axis.id: AxisPipeline(axis, monitor) for axis, monitor in zip(axes, self._fleet.monitors, strict=True)
        }
        keys = [axis.epoch.key(axis.monitor.history_key) for axis in self.axes.values()]
        self.trends = Trends(axes, models, keys)
        """The long-term trends of all axes"""
        self._deferred: dict[str, list[SampleBlock]] | None = None
        """Samples that wait for the multi-model detectors, by axis; None: the detectors take samples at once"""

    @property
    def by_id(self) -> Mapping[str, AxisMonitor]:
        """The monitor of each axis."""
        return {axis_id: axis.monitor for axis_id, axis in self.axes.items()}

    def update(self, samples: Samples, observer: Observer | None = None) -> list[AxisAlarm]:
        """Let every axis take its samples; returns the alarms that changed, axis by axis."""
        rest: Samples = {a: self.axes[a].unwrapped(block) for a, block in samples.items()}
        changed, first = list[AxisAlarm](), True
        while rest or first:  # at least once: without samples, this compiles the kernel
            parts = {a: axis.part(rest[a]) for a, axis in self.axes.items() if a in rest}
            changed += self._update({a: part for a, (part, _) in parts.items()}, observer)
            rest, first = {a: more for a, (_, more) in parts.items() if more is not None}, False
        return changed

    def _update(self, samples: Samples, observer: Observer | None) -> list[AxisAlarm]:
        ids = list(self.axes)
        blocks = {a: samples[i] for a, i in enumerate(ids) if i in samples}
        changed: list[AxisAlarm] = []
        at_once = self._deferred is None
        for a, update in self._fleet.update(blocks, traced=observer is not None, multimodel=at_once).items():
            axis_id, axis = ids[a], self.axes[ids[a]]
            if self._deferred is not None and axis.monitor.multimodel is not None:
                self._deferred.setdefault(axis_id, []).append(axis.monitor.judged(blocks[a]))
            self.trends.take(axis_id, axis.for_trend(update.readings))
            axis.epoch.take(update.readings)
            if observer is not None and update.trace is not None:
                observer(axis_id, blocks[a], update.trace)
            changed += [AxisAlarm(axis_id, change.alarm) for change in update.changes]
        return changed

    def defer_multimodel(self) -> None:
        """From now on, samples for the multi-model detectors wait until ``update_multimodel`` is called."""
        self._deferred = {}

    def update_multimodel(self) -> list[AxisAlarm]:
        """Pass the waiting samples to the multi-model detectors, in order; returns the alarms that changed."""
        deferred, self._deferred = self._deferred or {}, {}
        return [
            AxisAlarm(axis_id, change.alarm)
            for axis_id, blocks in deferred.items()
            for _, group in groupby(enumerate(blocks), _joinable)
            for change in self.axes[axis_id].monitor.update_multimodel(concatenate([block for _, block in group]))
        ]

    def change(self, axis_ids: Sequence[str], new: AxisMonitors) -> None:
        """Monitor exactly these axes from now on.  Axes in ``new`` get its monitors; the others keep theirs.

        ``new`` must not be used afterwards.
        """
        if self._deferred is not None:
            kept = set(axis_ids) - new.axes.keys()
            self._deferred = {a: blocks for a, blocks in self._deferred.items() if a in kept}
        self.axes = {a: new.axes.get(a) or self.axes[a] for a in axis_ids}
        self._fleet = Fleet.of_monitors([axis.monitor for axis in self.axes.values()])
        self.trends.change(axis_ids, new.trends)

    @property
    def deferred_samples(self) -> int:
        """Number of samples that wait for a multi-model detector."""
        return sum(block.size for blocks in (self._deferred or {}).values() for block in blocks)

    @property
    def restarted_windows(self) -> tuple[str, ...]:
        """Messages about running learning windows that had to start again, as their state could not be restored."""
        running = (axis.epoch.learning for axis in self.axes.values())
        return tuple(learning.restarted for learning in running if learning is not None and learning.restarted)

    @property
    def batch_sizes(self) -> list[int]:
        """Number of axes in each batch."""
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


def _joinable(numbered: tuple[int, SampleBlock]) -> tuple[object, ...]:
    """Key for ``groupby``: blocks with the same key may be joined into one.

    They have the same optional arrays.  A joined block is at most ``_BLOCKS_AT_ONCE`` long: of an alarm that is raised
    and ends within one block, only the end would be reported.
    """
    number, block = numbered
    return number // _BLOCKS_AT_ONCE, *(values is None for values in block)


# --- From frames to changed alarms: without clock, thread or file -----------------------------------------------------


class FramePipeline:
    """From the frames of all buses to changed alarms: ingest of every bus, monitors of every axis.

    ``axes``: the configured axes with the nominal values of their epochs; None: all have those of the configuration.

    Raises:
        AxisError: an axis cannot be monitored as configured.
        DescriptionError: a bus cannot be decoded as configured.
    """

    def __init__(self, config: Config, axes: Sequence[NamedAxis] | None = None) -> None:
        self.monitors = AxisMonitors(config.axes if axes is None else axes)
        self.ingests = {bus.name: Ingest(config, bus.name) for bus in config.bus}
        self.live = LiveSignals()
        """Samples and predictions of the last seconds, for the page"""
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

    def messages_of(self, axis_id: str) -> tuple[str, ...]:
        """Names of the messages from which the samples of an axis are made."""
        inputs = (ingest.axes[axis_id] for ingest in self.ingests.values() if axis_id in ingest.axes)
        return tuple(dict.fromkeys(q.message for axis in inputs for q in axis.sampled))

    def flush(self) -> None:
        """End the input: values without a partner are counted as dropped; the last samples wait for ``update``."""
        for ingest in self.ingests.values():
            self._keep(ingest.flush())

    def change_buses(self, names: Sequence[str], new: Mapping[str, Ingest]) -> None:
        """Take frames of exactly these buses from now on.

        Buses in ``new`` get a new ingest.  All frames that were received for the former one must have been taken.
        """
        for name, ingest in self.ingests.items():
            if name in new or name not in names:
                self._keep(ingest.flush())
        self.ingests = {name: new.get(name) or self.ingests[name] for name in names}

    def _keep(self, samples: Samples) -> None:
        for axis_id, block in samples.items():
            self._samples.setdefault(axis_id, []).append(block)
