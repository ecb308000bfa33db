"""Where the values of one axis are on its bus: values of a message in, samples out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from service.config.conditions import needed
from service.config.schema import AngleConfig, NamedAxis, SignalConfig
from service.ingest.assemble import Assembler
from service.ingest.clock import SampleClock
from service.ingest.dbc import DbcError, find_counter
from service.ingest.decode import Decoder, FrameKey
from service.ingest.errors import IngestError
from service.ingest.frames import Sample
from service.ingest.held import HeldSignal


class Quantity(NamedTuple):
    """One value of an axis: value = factor * signal + offset, SI on the motor side, or a further signal's own unit."""

    name: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    key: FrameKey
    message: str
    signal: str
    factor: float = 1.0
    offset: float = 0.0
    wraps_at: float | None = None

    def value(self, signals: Mapping[str, float]) -> float | None:
        """The value in SI units; None where a multiplexed signal is absent."""
        signal = signals.get(self.signal)
        return None if signal is None else self.factor * signal + self.offset


def wanted_signals(axis: NamedAxis) -> Iterator[tuple[str, str]]:
    """(message, signal) of all that an axis needs."""
    config = axis.config
    for source in (config.torque, config.motion):
        yield source.message, source.signal
    if config.time.counter_message and config.time.counter_signal:
        yield config.time.counter_message, config.time.counter_signal
    for further in needed(axis):
        if further.message is not None and further.signal is not None:
            yield further.message, further.signal


class AxisInput:
    """Samples of one axis from the decoded messages of its bus.

    Raises:
        IngestError: the counter or the tolerance of this axis cannot be used.
    """

    def __init__(self, axis: NamedAxis, decoder: Decoder) -> None:
        config = axis.config
        self.id = axis.id
        self._interval_s = config.sample_interval_s
        self.torque = _quantity("torque", config.torque, decoder)
        self.motion = _quantity(config.output, config.motion, decoder)
        self.further = [HeldSignal(s, decoder.key(s.message or "")) for s in needed(axis)]
        """Further signals that its samples carry, in the order of the configuration."""
        self.counter: Quantity | None = None
        self._counter_offset = 0.0
        self._clock: SampleClock | None = None
        try:
            self.assembler = Assembler(
                config.sample_interval_s, config.pairing_tolerance_s, config.maximum_gap_s
            )
        except IngestError as error:
            raise IngestError(f"axis {axis.id}: {error}") from None
        if config.time.counter_message and config.time.counter_signal:
            key = decoder.key(config.time.counter_message)
            self.counter = Quantity("counter", key, config.time.counter_message, config.time.counter_signal)
            self._check_counter(decoder)

    @property
    def keys(self) -> set[FrameKey]:
        """The frames that carry a value of this axis."""
        return {self.torque.key, self.motion.key}

    @property
    def reanchored(self) -> int:
        """How often the sample clock was set to the time of receipt again."""
        return self._clock.reanchored if self._clock else 0

    def take(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> Sample | None:
        """Take the signals of a frame received at that time [us]; returns the sample that they complete."""
        sample = self._take(key, t_us, signals)
        if sample is None or not self.further:
            return sample
        return sample._replace(signals=tuple(held.at(t_us) for held in self.further))

    def _take(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> Sample | None:
        torque = self.torque.value(signals) if self.torque.key == key else None
        motion = self.motion.value(signals) if self.motion.key == key else None
        values = (torque is not None) + (motion is not None)
        if not values:
            return None
        sample_us = self._count(key, t_us, signals)
        if isinstance(sample_us, str):
            self.assembler.drop(sample_us, values)
            return None
        if torque is not None and motion is not None:
            return self.assembler.add_pair(t_us, torque, motion, sample_us)
        if torque is not None:
            return self.assembler.add("torque", t_us, torque, sample_us)
        assert motion is not None
        return self.assembler.add("motion", t_us, motion, sample_us)

    def quantities(self) -> Iterator[Quantity]:
        """Torque, motion and the counter, where there is one; then the further signals."""
        yield from self.sampled()
        yield from self.further_quantities()

    def sampled(self) -> Iterator[Quantity]:
        """Torque, motion and the counter, where there is one."""
        yield self.torque
        yield self.motion
        if self.counter:
            yield self.counter

    def further_quantities(self) -> Iterator[Quantity]:
        """Further signals, as they are called outside."""
        for h in self.further:
            yield Quantity(f"signal {h.name}", h.key, h.message, h.signal, h.factor, h.offset)

    def _count(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> int | str | None:
        if self.counter is None or self._clock is None or self.counter.key != key:
            return None
        count = self.counter.value(signals)
        return None if count is None else self._clock.read(t_us, self._raw(count))

    def _raw(self, count: float) -> int:
        assert self.counter is not None
        return round(count - self._counter_offset)

    def _check_counter(self, decoder: Decoder) -> None:
        assert self.counter is not None
        if self.counter.key not in self.keys:
            raise IngestError(
                f"axis {self.id}: counter_message is {self.counter.message}, but the counter must be in the "
                f"message of the torque, {self.torque.message}, or of the {self.motion.name}, "
                f"{self.motion.message}"
            )
        try:
            signal = find_counter(decoder.message(self.counter.key), self.counter.signal)
        except DbcError as error:
            raise IngestError(f"axis {self.id}: {error}") from None
        self._counter_offset = signal.offset
        self._clock = SampleClock(self._interval_s, signal.length)


def _quantity(name: str, source: SignalConfig, decoder: Decoder) -> Quantity:
    key = decoder.key(source.message)
    wraps_at = source.wraps_at if isinstance(source, AngleConfig) else None
    return Quantity(name, key, source.message, source.signal, source.factor, source.offset, wraps_at)
