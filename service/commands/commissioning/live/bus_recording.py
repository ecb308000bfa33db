"""Records all frames on the buses as received, and counts what was received."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import moves
from service.can.frame_recorder import FrameRecorder
from service.can.frames import FrameKey
from service.commands.command_line.live_buses import LiveBus, live_buses, rounds
from service.config import Config
from service.ingest.samples.bus_samples import QuantityValues
from service.ingest.samples.timestamp_jitter import Stamps

_SHOW_S = 1.0


class Heard(NamedTuple):
    """Results of a recording."""

    seconds: float
    """Duration of the recording"""
    traffic: Mapping[str, Counter[FrameKey]]
    """Number of frames by bus and identifier"""
    states: Mapping[str, str]
    """State of each bus at the end, as its reader reports it"""
    lost: Mapping[str, Mapping[str, int]]
    """Number of dropped frames, by bus and reason"""
    stamps: Mapping[str, Stamps]
    """Time stamps of each axis"""

    @property
    def frames(self) -> int:
        """Number of frames of all buses."""
        return sum(counts.total() for counts in self.traffic.values())


Show = Callable[[str, float, float], None]
"""Called about once a second with a text on the recording, the elapsed and the requested time [s]."""


def record_buses(config: Config, path: Path, seconds: float, stop: Event, show: Show) -> Heard:
    """Record everything on the buses, as received, until the time is over or ``stop`` is set.

    All frames are recorded, since the record must also contain signals that are corrected later.  Without frames no
    file is left behind.

    Raises:
        BusError: a bus cannot be opened.
        DescriptionError, IngestError: the configuration cannot be used.
        RecordError: the file cannot be written; what was written is kept.
    """
    traffic = {bus.name: Counter[FrameKey]() for bus in config.bus}
    began = shown = time.monotonic()
    with live_buses(config, everything=True) as buses, FrameRecorder(path) as recorder:
        motions = _Motions(config)
        for block in rounds([bus.reader for bus in buses], seconds, stop):
            for bus, frames in zip(buses, block, strict=True):
                recorder.write(bus.name, frames)
                traffic[bus.name].update(frames.counts())
                motions.add(bus.ingest.feed_values(frames))
            now = time.monotonic()
            if now - shown >= _SHOW_S:
                shown = now
                heard = sum(counts.total() for counts in traffic.values())
                words = f"{heard} frames, {motions.take()} of {len(config.axes)} axes move{_lost_words(buses)}"
                show(words, now - began, seconds)
        states = {bus.name: bus.reader.stats().state for bus in buses}
        lost = {bus.name: bus.lost for bus in buses}
        stamps = {axis_id: axis.stamps for bus in buses for axis_id, axis in bus.ingest.axes.items()}
    found = Heard(min(seconds, time.monotonic() - began), traffic, states, lost, stamps)
    if not found.frames:
        path.unlink(missing_ok=True)
    return found


def _lost_words(buses: Sequence[LiveBus]) -> str:
    counts = sum((Counter(bus.lost) for bus in buses), Counter[str]())
    down = [f"; {bus.name} is {bus.reader.stats().state}" for bus in buses if not bus.reader.stats().up]
    lost = ", ".join(f"{n} {reason}" for reason, n in counts.items())
    return (f"; dropped: {lost}" if lost else "") + "".join(down)


class _Motions:
    """Finds the axes that have moved since the last query."""

    def __init__(self, config: Config) -> None:
        self._quantities = {axis.id: axis.config.output for axis in config.axes}
        self._values: dict[str, list[Floats]] = {}

    def add(self, values: Iterator[QuantityValues]) -> None:
        for found in values:
            if found.quantity == self._quantities[found.axis_id]:
                self._values.setdefault(found.axis_id, []).append(found.si)

    def take(self) -> int:
        """Number of axes that have moved since the last call."""
        found = sum(moves(np.concatenate(values), self._quantities[a]) for a, values in self._values.items())
        self._values.clear()
        return found
