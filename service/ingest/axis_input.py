"""Input of one axis from its bus: decoded values of messages in, samples out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from service.can.dbc import DbcError, Decoder, find_counter
from service.can.frames import FrameKey, Sample
from service.can.user_errors import IngestError
from service.config.schema import NamedAxis, Source
from service.ingest.assemble import Assembler
from service.ingest.clocks import CyclicClock, SampleClock
from service.ingest.quantities import HeldSignal, Quantity, quantity_of
from service.ingest.timestamp_jitter import StampMeter, Stamps


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

    Args:
        axis: as configured.
        decoder: of its bus; it is asked for the signals of this axis.
        signals: the auxiliary signals that the samples carry.

    Raises:
        DbcError: the DBC has no such message or signal.
        IngestError: the counter or the tolerance of this axis cannot be used.
    """

    def __init__(self, axis: NamedAxis, decoder: Decoder, signals: Iterable[Source]) -> None:
        config = axis.config
        self.id = axis.id
        self.torque = quantity_of("torque", config.torque, decoder)
        self.motion = quantity_of(config.output, config.motion, decoder)
        self.held = [HeldSignal(source, decoder) for source in signals]
        """Auxiliary signals that its samples carry, in this order."""
        self.counter: Quantity | None = None
        self._counter_offset = 0.0
        self._clock: SampleClock | None = None
        self._cyclic: tuple[CyclicClock[_Values], CyclicClock[_Values]] | None = None  # of torque, of motion
        self._meter = StampMeter(config.sample_interval_s)
        self._received_us = 0
        cyclic, interval_s = config.time.clock == "cyclic", config.sample_interval_s
        try:
            self._assembler = Assembler(
                interval_s,
                config.pairing_tolerance_s,
                config.max_gap_s,
                _HELD if cyclic else 1.0,
                config.output,
            )
        except IngestError as error:
            raise IngestError(f"axis {axis.id}: {error}") from None
        message, signal = config.time.counter_message, config.time.counter_signal
        if message and signal:
            self.counter = Quantity("counter", decoder.want(message, signal), message, signal)
            self._clock = self._counting(self.counter, decoder, interval_s)
        elif cyclic:
            self._cyclic = CyclicClock(interval_s), CyclicClock(interval_s)

    @property
    def keys(self) -> set[FrameKey]:
        """The frames that carry values of this axis."""
        return {self.torque.key, self.motion.key}

    @property
    def sampled(self) -> tuple[Quantity, ...]:
        """Torque, motion, and the counter, where there is one."""
        return (self.torque, self.motion, *([self.counter] if self.counter else []))

    @property
    def dropped(self) -> Mapping[str, int]:
        """Values that became no sample, by service.ingest.assemble.REASONS."""
        return dict(self._assembler.dropped)

    @property
    def events(self) -> Mapping[str, int]:
        """Restarts of the time line: clock_reanchored (counter, fitted clock), clock_set_back (receipt)."""
        clocks = self._cyclic or ((self._clock,) if self._clock else ())
        reanchored = max((clock.reanchored for clock in clocks), default=0)
        return {"clock_reanchored": reanchored, "clock_set_back": self._assembler.clock_set_back}

    @property
    def stamps(self) -> Stamps:
        """Scatter of the time stamps."""
        if self._cyclic:
            return self._meter.stamps("cyclic", self._cyclic[1].interval_s)
        if self._clock:
            return self._meter.stamps("counter", self._clock.interval_s)
        return self._meter.stamps("receipt")

    def take(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> Sequence[Sample]:
        """Take the signals of a frame received at that time [us]; returns the samples that are now complete."""
        self._received_us = t_us
        return self._with_held(self._take(key, t_us, signals))

    def flush(self) -> Sequence[Sample]:
        """End of the frames: the samples of held values; values without a partner are counted."""
        samples = [sample for clock in self._cyclic or () for sample in self._timed(clock.flush())]
        self._assembler.flush()
        return self._with_held(samples)

    def _with_held(self, samples: Sequence[Sample]) -> Sequence[Sample]:
        if not samples or not self.held:
            return samples
        signals = tuple(held.at(self._received_us) for held in self.held)
        return [sample._replace(signals=signals) for sample in samples]

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
            self._assembler.drop(sample_us, values.number)
            return ()
        if sample_us is not None:
            self._meter.timed(t_us, sample_us)
        return self._assemble(values, t_us, sample_us)

    def _timed(self, read: Iterable[tuple[_Values, int | str]]) -> list[Sample]:
        """The samples completed by values whose times are known now."""
        samples = list[Sample]()
        for values, time_us in read:
            if isinstance(time_us, str):
                self._assembler.drop(time_us, values.number)
                continue
            if values.motion is not None:
                self._meter.timed(values.t_us, time_us)
            samples += self._assemble(values, time_us)
        return samples

    def _assemble(self, values: _Values, t_us: int, sample_us: int | None = None) -> Sequence[Sample]:
        _, torque, motion = values
        if torque is not None and motion is not None:
            sample = self._assembler.add_pair(t_us, torque, motion, sample_us)
        elif torque is not None:
            sample = self._assembler.add("torque", t_us, torque, sample_us)
        else:
            assert motion is not None
            sample = self._assembler.add("motion", t_us, motion, sample_us)
        return () if sample is None else (sample,)

    def _count(self, key: FrameKey, t_us: int, signals: Mapping[str, float]) -> int | str | None:
        """The time [us] by the counter in these signals, or why there is none; None: no counter in them."""
        if self.counter is None or self._clock is None or self.counter.key != key:
            return None
        count = self.counter.value(signals)
        return None if count is None else self._clock.read(t_us, round(count - self._counter_offset))

    def _counting(self, counter: Quantity, decoder: Decoder, interval_s: float) -> SampleClock:
        if counter.key not in self.keys:
            raise IngestError(
                f"axis {self.id}: counter_message is {counter.message}, but the counter must be in the "
                f"message of the torque, {self.torque.message}, or of the {self.motion.name}, "
                f"{self.motion.message}"
            )
        try:
            signal = find_counter(decoder.message(counter.key), counter.signal)
        except DbcError as error:
            raise IngestError(f"axis {self.id}: {error}") from None
        self._counter_offset = signal.offset
        return SampleClock(interval_s, signal.length)
