"""Input of one axis from its bus: decoded messages of a block of frames in, a block of samples out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from monitor_core.samples import SampleBlock
from service.can.dbc import Column, DbcError, Decoded, Decoder, find_counter
from service.can.frames import FrameKey
from service.can.user_errors import IngestError
from service.config.schema import NamedAxis, Source
from service.ingest.assemble import Assembler, Sample
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

    def take(self, decoded: Mapping[FrameKey, Decoded]) -> SampleBlock | None:
        """Take the messages in a block of frames; returns the samples that are now complete, if there are any."""
        samples, places, received = list[Sample](), list[int](), list[int]()
        for place, t_us, *values in self._received(decoded):
            self._received_us = t_us
            for sample in self._take(t_us, *values):
                samples.append(sample)
                places.append(place)
                received.append(t_us)
        return self._block(samples, decoded, places, received)

    def flush(self) -> SampleBlock | None:
        """End of the frames: the samples of held values; values without a partner are counted."""
        samples = [sample for clock in self._cyclic or () for sample in self._timed(clock.flush())]
        self._assembler.flush()
        number = len(samples)
        return self._block(samples, {}, [0] * number, [self._received_us] * number)

    def _block(
        self,
        samples: list[Sample],
        decoded: Mapping[FrameKey, Decoded],
        places: list[int],
        received: list[int],
    ) -> SampleBlock | None:
        """The samples with the auxiliary signals of the frames that completed them."""
        at, at_us = np.array(places, np.int64), np.array(received, np.int64)
        held = [held.take(decoded, at, at_us) for held in self.held]
        if not samples:
            return None
        t_us, torque, motion = zip(*samples, strict=True)
        return SampleBlock(
            np.array(t_us, np.int64),
            np.array(torque, np.float64),
            np.array(motion, np.float64),
            signals=np.stack(held, axis=1) if held else None,
        )

    def _received(self, decoded: Mapping[FrameKey, Decoded]) -> list[tuple[Any, ...]]:
        """Place in the block, time of receipt, torque, motion and count of its frames, in the order of receipt."""
        rows = list[tuple[Any, ...]]()
        for key in self.keys:
            if (found := decoded.get(key)) is None:
                continue
            none = [None] * len(found.places)
            columns = [
                none if q is None or q.key != key else _numbers(q.column(found.signals))
                for q in (self.torque, self.motion, self.counter)
            ]
            rows += zip(found.places.tolist(), found.t_us.tolist(), *columns, strict=True)
        if len(self.keys) > 1:
            rows.sort(key=itemgetter(0))
        return rows

    def _take(
        self, t_us: int, torque: float | None, motion: float | None, count: float | None
    ) -> Iterable[Sample]:
        if torque is None and motion is None:
            return ()
        if motion is not None:
            self._meter.received(t_us)
        values = _Values(t_us, torque, motion)
        if self._cyclic:
            return self._timed(self._cyclic[motion is not None].read(t_us, values))
        sample_us = self._count(t_us, count)
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

    def _assemble(self, values: _Values, t_us: int, sample_us: int | None = None) -> Iterable[Sample]:
        _, torque, motion = values
        if torque is not None and motion is not None:
            sample = self._assembler.add_pair(t_us, torque, motion, sample_us)
        elif torque is not None:
            sample = self._assembler.add("torque", t_us, torque, sample_us)
        else:
            assert motion is not None
            sample = self._assembler.add("motion", t_us, motion, sample_us)
        return () if sample is None else (sample,)

    def _count(self, t_us: int, count: float | None) -> int | str | None:
        """The time [us] by this count, or why there is none; None: there is no counter in the frame."""
        if count is None or self._clock is None:
            return None
        return self._clock.read(t_us, round(count - self._counter_offset))

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


def _numbers(column: Column) -> list[float | None]:
    """The values, None where there is none."""
    values: list[float | None] = column.values.tolist()
    if column.present.all():
        return values
    return [value if there else None for value, there in zip(values, column.present.tolist(), strict=True)]
