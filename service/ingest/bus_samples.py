"""Frames of one bus in, samples of its axes out: the same code for the daemon and for replay."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.samples import SampleBlock
from service.can.dbc import Decoder
from service.can.frames import Frame, FrameKey, Sample
from service.config.conditions import needed
from service.config.schema import Config, Source
from service.ingest.axis_input import AxisInput
from service.ingest.quantities import HeldSignal

FRAME_REASONS = ("unwanted", "too_short", "undecodable", "signal_absent")
"""Why a frame gave nothing (or, signal_absent, not all that was wanted): ``Ingest.dropped``."""

Carried = Mapping[str, Sequence[Source]]
"""The auxiliary signals that samples carry, by axis; other axes are not read."""


def carried_by(config: Config) -> Carried:
    """The signals that the monitoring of each axis needs."""
    return {axis.id: needed(axis) for axis in config.axes}


def block_of(samples: Sequence[Sample]) -> SampleBlock:
    """A block of samples from at least one sample."""
    t_us, torque, motion, signals = zip(*samples, strict=True)
    further = np.array(signals, float) if signals[0] else None
    times = np.array(t_us, np.int64)
    return SampleBlock(times, np.array(torque, float), np.array(motion, float), signals=further)


class Value(NamedTuple):
    """A value as decoded, before pairing."""

    t_us: int
    axis_id: str
    quantity: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    message: str
    signal: str
    physical: float  # as the DBC says
    si: float  # N m, rad or rad/s on the motor side; of a further signal, its own unit


class Ingest:
    """Ingest of the axes of one bus.

    Args:
        config: the whole configuration.
        bus: name of one of its buses.
        carried: axes and their signals; None: as the monitoring needs them.

    Raises:
        DbcError: the DBC cannot be read, or has no such message or signal.
        IngestError: settings of an axis contradict each other.
    """

    def __init__(self, config: Config, bus: str, carried: Carried | None = None) -> None:
        signals = carried_by(config) if carried is None else carried
        axes = [axis for axis in config.axes if axis.config.bus == bus and axis.id in signals]
        self.decoder = Decoder(next(described.dbc for described in config.bus if described.name == bus))
        self.axes = {axis.id: AxisInput(axis, self.decoder, signals[axis.id]) for axis in axes}
        """The axes on this bus, by their names"""
        self._inputs: dict[FrameKey, list[AxisInput]] = {key: [] for key in self.decoder.keys}
        self._held: dict[FrameKey, list[HeldSignal]] = {}
        for axis in self.axes.values():
            for key in axis.keys:
                self._inputs[key].append(axis)
            for held in axis.held:
                self._held.setdefault(held.quantity.key, []).append(held)
        self._dropped = dict.fromkeys(FRAME_REASONS, 0)

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The wanted frames, for the filters of the bus."""
        return self.decoder.keys

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames that yielded nothing, by FRAME_REASONS."""
        return dict(self._dropped)

    def feed(self, frames: Iterable[Frame]) -> dict[str, list[Sample]]:
        """The samples that these frames complete, by axis, in the order of their times."""
        samples: dict[str, list[Sample]] = {}
        for frame in frames:
            signals = self._signals(frame)
            if signals is None:
                continue
            key = frame.key
            for held in self._held.get(key, ()):  # first: they may belong to the sample that is completed now
                held.take(frame.t_us, signals)
            for axis in self._inputs[key]:
                found = axis.take(key, frame.t_us, signals)
                if found:
                    samples.setdefault(axis.id, []).extend(found)
        return samples

    def feed_values(self, frames: Iterable[Frame]) -> Iterator[Value]:
        """The values in these frames, to inspect a bus.  Counts, pairs and times as ``feed`` does."""
        for frame in frames:
            signals = self._signals(frame)
            if signals is None:
                continue
            for axis in self._inputs[frame.key]:
                axis.take(frame.key, frame.t_us, signals)
            for axis in self.axes.values():
                for q in (*axis.sampled, *(held.quantity for held in axis.held)):
                    if q.key == frame.key and (si := q.value(signals)) is not None:
                        yield Value(frame.t_us, axis.id, q.name, q.message, q.signal, signals[q.signal], si)

    def flush(self) -> dict[str, list[Sample]]:
        """End of the frames: samples whose times were not known yet; values without a partner are counted."""
        flushed = {axis_id: list(axis.flush()) for axis_id, axis in self.axes.items()}
        return {axis_id: samples for axis_id, samples in flushed.items() if samples}

    def _signals(self, frame: Frame) -> dict[str, float] | None:
        """The wanted signals in a frame; counts the frame where some or all are missing."""
        signals = self.decoder.decode(frame)
        if isinstance(signals, str):
            self._dropped[signals] += 1
            return None
        if len(signals) < len(self.decoder.wanted(frame.key)):
            self._dropped["signal_absent"] += 1
        return signals or None
