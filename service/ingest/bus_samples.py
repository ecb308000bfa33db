"""Frames of one bus in, samples of its axes out: the same code for the daemon and for replay."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.samples import SampleBlock
from service.can.decode import Decoder, FrameKey
from service.can.frames import Frame, Sample
from service.can.user_errors import IngestError
from service.config.schema import BusConfig, Config
from service.ingest.auxiliary_signals import HeldSignal
from service.ingest.axis_input import AxisInput, Quantity, wanted_signals
from service.ingest.timestamp_jitter import Stamps

FRAME_REASONS = ("unwanted", "too_short", "undecodable", "signal_absent")
"""Why a frame gave nothing (or, signal_absent, not all that was wanted): ``Ingest.dropped``."""


def block_of(samples: Sequence[Sample]) -> SampleBlock:
    """A block of samples from at least one sample."""
    t_us, torque, motion, signals = zip(*samples, strict=True)
    further = np.array(signals, float) if signals[0] else None
    return SampleBlock(
        np.array(t_us, np.int64),
        np.array(torque, float),
        np.array(motion, float),
        signals=further,
    )


class Step(NamedTuple):
    """Samples by axis of a part of a record; ``done`` is how much of it has been read, 0 to 1."""

    samples: Mapping[str, SampleBlock]
    done: float


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
        bus: name of the bus.

    Raises:
        DbcError: the DBC cannot be read, or has no such message or signal.
        IngestError: settings of an axis contradict each other.
    """

    def __init__(self, config: Config, bus: str) -> None:
        self.bus = _bus(config, bus)
        axes = [axis for axis in config.axes if axis.config.bus == bus]
        self.decoder = Decoder(self.bus.dbc, [wanted for axis in axes for wanted in wanted_signals(axis)])
        self.axes = [AxisInput(axis, self.decoder) for axis in axes]
        self._inputs: dict[FrameKey, list[AxisInput]] = {key: [] for key in self.decoder.keys}
        self._held: dict[FrameKey, list[HeldSignal]] = {}
        self._quantities: dict[FrameKey, list[tuple[str, Quantity]]] = {key: [] for key in self.decoder.keys}
        for axis in self.axes:
            for key in axis.keys:
                self._inputs[key].append(axis)
            for held in axis.further:
                self._held.setdefault(held.key, []).append(held)
            for quantity in axis.quantities():
                self._quantities[quantity.key].append((axis.id, quantity))
        self._dropped = dict.fromkeys(FRAME_REASONS, 0)

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The wanted frames, for the filters of the bus."""
        return self.decoder.keys

    @property
    def axis_ids(self) -> tuple[str, ...]:
        """The axes on this bus."""
        return tuple(axis.id for axis in self.axes)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames that yielded nothing, by FRAME_REASONS."""
        return dict(self._dropped)

    def axis_dropped(self, axis_id: str) -> Mapping[str, int]:
        """Values of an axis that became no sample, by REASONS."""
        return dict(self._axis(axis_id).assembler.dropped)

    def axis_events(self, axis_id: str) -> Mapping[str, int]:
        """Restarts of the time line of an axis: clock_reanchored (counter, fitted clock), clock_set_back (receipt)."""
        axis = self._axis(axis_id)
        return {"clock_reanchored": axis.reanchored, "clock_set_back": axis.assembler.clock_set_back}

    def axis_stamps(self, axis_id: str) -> Stamps:
        """Scatter of the time stamps of an axis."""
        return self._axis(axis_id).stamps

    def feed(self, frames: Iterable[Frame]) -> dict[str, list[Sample]]:
        """The samples that these frames complete, by axis, in the order of their times."""
        samples: dict[str, list[Sample]] = {}
        for frame in frames:
            signals = self._signals(frame)
            if signals is None:
                continue
            key = FrameKey(frame.can_id, frame.extended)
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
            key = FrameKey(frame.can_id, frame.extended)
            for axis in self._inputs[key]:
                axis.take(key, frame.t_us, signals)
            for axis_id, quantity in self._quantities[key]:
                si = quantity.value(signals)
                if si is not None:
                    name, physical = quantity.signal, signals[quantity.signal]
                    yield Value(frame.t_us, axis_id, quantity.name, quantity.message, name, physical, si)

    def flush(self) -> dict[str, list[Sample]]:
        """End of the frames: samples whose times were not known yet; values without a partner are counted."""
        flushed = {axis.id: list(axis.flush()) for axis in self.axes}
        return {axis_id: samples for axis_id, samples in flushed.items() if samples}

    def _axis(self, axis_id: str) -> AxisInput:
        return next(axis for axis in self.axes if axis.id == axis_id)

    def _signals(self, frame: Frame) -> dict[str, float] | None:
        """The wanted signals in a frame; counts the frame where some or all are missing."""
        signals = self.decoder.decode(frame)
        if isinstance(signals, str):
            self._dropped[signals] += 1
            return None
        if len(signals) < len(self.decoder.wanted(FrameKey(frame.can_id, frame.extended))):
            self._dropped["signal_absent"] += 1
        return signals or None


def _bus(config: Config, name: str) -> BusConfig:
    for bus in config.bus:
        if bus.name == name:
            return bus
    raise IngestError(f"no bus {name} in the configuration; there is {', '.join(b.name for b in config.bus)}")
