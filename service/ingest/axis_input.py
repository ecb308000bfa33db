"""Input of one axis from its bus: decoded values of messages in, samples out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from service.can.dbc import DbcError, find_counter
from service.can.decode import Decoder, FrameKey
from service.can.frames import Sample
from service.can.user_errors import IngestError
from service.config.conditions import needed
from service.config.schema import NamedAxis
from service.config.schema_signals import AngleConfig, SignalConfig
from service.ingest.assemble import Assembler
from service.ingest.auxiliary_signals import HeldSignal
from service.ingest.clock import SampleClock
from service.ingest.cyclic import CyclicClock
from service.ingest.timestamp_jitter import StampMeter, Stamps


class Quantity(NamedTuple):
    """One value of an axis: value = factor * signal + offset.

    SI on the motor side; auxiliary signals in their own unit.
    """

    name: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    key: FrameKey
    message: str
    signal: str
    factor: float = 1.0
    offset: float = 0.0
    wrap_period: float | None = None

    def value(self, signals: Mapping[str, float]) -> float | None:
        """The value in SI units; None where a multiplexed signal is absent."""
        signal = signals.get(self.signal)
        return None if signal is None else self.factor * signal + self.offset


def wanted_signals(axis: NamedAxis) -> Iterator[tuple[str, str]]:
    """(message, signal) of all signals that an axis needs."""
    config = axis.config
    for source in (config.torque, config.motion):
        yield source.message, source.signal
    if config.time.counter_message and config.time.counter_signal:
        yield config.time.counter_message, config.time.counter_signal
    for further in needed(axis):
        if further.message is not None and further.signal is not None:
            yield further.message, further.signal


class _Values(NamedTuple):
    """The values of an axis in a frame, and the time of receipt."""

    t_us: int
    torque: float | None
    motion: float | None

    @property
    def number(self) -> int:
        return (self.torque is not None) + (self.motion is not None)


_HELD = 4.0
"""Intervals that a value waits for its partner, where that may be held until its cycle is known."""


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
        self._cyclic: tuple[CyclicClock[_Values], CyclicClock[_Values]] | None = None  # of torque, of motion
        self._meter = StampMeter(config.sample_interval_s)
        self._received_us = 0
        cyclic = config.time.clock == "cyclic"
        try:
            self.assembler = Assembler(
                config.sample_interval_s,
                config.pairing_tolerance_s,
                config.max_gap_s,
                _HELD if cyclic else 1.0,
            )
        except IngestError as error:
            raise IngestError(f"axis {axis.id}: {error}") from None
        if config.time.counter_message and config.time.counter_signal:
            key = decoder.key(config.time.counter_message)
            self.counter = Quantity("counter", key, config.time.counter_message, config.time.counter_signal)
            self._check_counter(decoder)
        elif cyclic:
            self._cyclic = CyclicClock(config.sample_interval_s), CyclicClock(config.sample_interval_s)

    @property
    def keys(self) -> set[FrameKey]:
        """The frames that carry values of this axis."""
        return {self.torque.key, self.motion.key}

    @property
    def reanchored(self) -> int:
        """How often the sample clock was set to the time of receipt again."""
        if self._cyclic:
            return max(clock.reanchored for clock in self._cyclic)
        return self._clock.reanchored if self._clock else 0

    @property
    def stamps(self) -> Stamps:
        """Scatter of the time stamps of the axis."""
        if self._cyclic:
            return self._meter.stamps("cyclic", self._cyclic[1].interval_s)
        if self._clock:
            return self._meter.stamps("counter", self._clock.interval_s)
        return self._meter.stamps("receipt")

    def take(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> Sequence[Sample]:
        """Take the signals of a frame received at that time [us]; returns the samples that are now complete."""
        self._received_us = t_us
        return self._with_further(self._take(key, t_us, signals))

    def flush(self) -> Sequence[Sample]:
        """End of the frames: the samples of held values; values without a partner are counted."""
        samples = list[Sample]()
        for clock in self._cyclic or ():
            samples += self._timed(clock.flush())
        self.assembler.flush()
        return self._with_further(samples)

    def _with_further(self, samples: Sequence[Sample]) -> Sequence[Sample]:
        if not samples or not self.further:
            return samples
        further = tuple(held.at(self._received_us) for held in self.further)
        return [sample._replace(signals=further) for sample in samples]

    def _take(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> Sequence[Sample]:
        torque = self.torque.value(signals) if self.torque.key == key else None
        motion = self.motion.value(signals) if self.motion.key == key else None
        if torque is None and motion is None:
            return ()
        if motion is not None:
            self._meter.received(t_us)
        values = _Values(t_us, torque, motion)
        if self._cyclic:
            return self._timed(self._cyclic[motion is not None].read(t_us, values))
        sample_us = self._count(key, t_us, signals)
        if isinstance(sample_us, str):
            self.assembler.drop(sample_us, values.number)
            return ()
        if sample_us is not None:
            self._meter.timed(t_us, sample_us)
        sample = self._assemble(values, t_us, sample_us)
        return () if sample is None else (sample,)

    def _timed(self, read: Iterable[tuple[_Values, int | str]]) -> list[Sample]:
        """The samples completed by values whose times are known now."""
        samples = list[Sample]()
        for values, time_us in read:
            if isinstance(time_us, str):
                self.assembler.drop(time_us, values.number)
                continue
            if values.motion is not None:
                self._meter.timed(values.t_us, time_us)
            sample = self._assemble(values, time_us)
            if sample is not None:
                samples.append(sample)
        return samples

    def _assemble(self, values: _Values, t_us: int, sample_us: int | None = None) -> Sample | None:
        _, torque, motion = values
        if torque is not None and motion is not None:
            return self.assembler.add_pair(t_us, torque, motion, sample_us)
        if torque is not None:
            return self.assembler.add("torque", t_us, torque, sample_us)
        assert motion is not None
        return self.assembler.add("motion", t_us, motion, sample_us)

    def quantities(self) -> Iterator[Quantity]:
        """All quantities: ``sampled``, then the auxiliary signals."""
        yield from self.sampled()
        yield from self.further_quantities()

    def sampled(self) -> Iterator[Quantity]:
        """Torque, motion, and the counter, where there is one."""
        yield self.torque
        yield self.motion
        if self.counter:
            yield self.counter

    def further_quantities(self) -> Iterator[Quantity]:
        """The auxiliary signals under their external names."""
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
    wrap_period = source.wrap_period if isinstance(source, AngleConfig) else None
    return Quantity(name, key, source.message, source.signal, source.factor, source.offset, wrap_period)
