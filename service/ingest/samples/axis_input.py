"""Makes the samples of one axis from the decoded messages of its bus, block by block."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from monitor_core import sampling
from monitor_core.samples import PHYSICAL_LIMITS, SampleBlock
from service.can.decoder import Decoded, Decoder
from service.can.frames import FrameKey
from service.can.messages import find_signal
from service.config.schema import FurtherSignalConfig, NamedAxis
from service.ingest.samples.late_values import LateValues
from service.ingest.samples.quantities import AxisQuantity, HeldSignal, quantity_of
from service.ingest.samples.timestamp_jitter import Stamps, stamps_of

_CYCLIC_PATIENCE = 4.0
"""Intervals that a value waits for its partner with a cyclic clock, as the partner may be held until its cycle is
known."""


class AxisInput:
    """Makes the samples of one axis, with its auxiliary ``signals``.

    The constructor registers the signals of this axis with the decoder of the bus.

    Raises:
        DescriptionError: the bus has no such message or signal.
    """

    def __init__(self, axis: NamedAxis, decoder: Decoder, signals: Sequence[FurtherSignalConfig]) -> None:
        config = axis.config
        self.id = axis.id
        self.torque = quantity_of("torque", config.torque, decoder)
        self.motion = quantity_of(config.output, config.motion, decoder)
        self.held = [HeldSignal(source, decoder, config.sample_interval_s) for source in signals]
        """The auxiliary signals of the samples, in this order."""
        self.coupled = [HeldSignal(s, decoder, config.sample_interval_s, coupled=True) for s in axis.coupled]
        """What is added to the motion of the axis to make that of its motor."""
        self.counter: AxisQuantity | None = None
        self._late = LateValues(config, signals, len(self.coupled), 1 if self.coupled else 0)
        self.keys = {self.torque.key, self.motion.key}
        """Keys of the frames that carry values of this axis"""
        interval_s, kind, patience = config.sample_interval_s, sampling.RECEIPT, 1.0
        clocks = sampling.counter_clock(interval_s, 1), sampling.counter_clock(interval_s, 1)
        message, signal = config.time.counter_message, config.time.counter_signal
        if message and signal:
            self.counter = AxisQuantity("counter", decoder.want(message, signal), message, signal)
            _, counter = find_signal(decoder.known, message, signal)
            kind = sampling.COUNTER
            clocks = sampling.counter_clock(interval_s, counter.length, counter.offset), clocks[1]
        elif config.time.clock == "cyclic":
            kind, patience = sampling.CYCLIC, _CYCLIC_PATIENCE
            clocks = sampling.cyclic_clock(interval_s), sampling.cyclic_clock(interval_s)
        limits = PHYSICAL_LIMITS["torque"], PHYSICAL_LIMITS[config.output]
        pairing = sampling.new_pairing(interval_s, config.pairing_tolerance_s, config.max_gap_s, patience, limits)
        bits = sampling.HAS_TORQUE, sampling.HAS_MOTION, sampling.HAS_COUNT
        self._columns = tuple(zip(self.sampled, ("torque", "motion", "counter"), bits, strict=False))
        """Each quantity with its column name and its bit in FRAME"""
        self._stream = sampling.Stream(kind, clocks, pairing, sampling.new_meter(interval_s), sampling.new_scratch())

    @property
    def sampled(self) -> tuple[AxisQuantity, ...]:
        """Torque, motion, and the counter if there is one."""
        return (self.torque, self.motion, *([self.counter] if self.counter else []))

    @property
    def quantities(self) -> tuple[AxisQuantity, ...]:
        """All quantities that its samples are made of: also its auxiliary signals and the coupled motion of others."""
        return (*self.sampled, *(signal.quantity for signal in (*self.held, *self.coupled)))

    @property
    def dropped(self) -> Mapping[str, int]:
        """Number of dropped values by reason (monitor_core.sampling.DROP_REASONS)."""
        counts = self._stream.pairing.counts
        return counts | {"unpaired": counts["unpaired"] + self._late.unpaired}

    @property
    def events(self) -> Mapping[str, int]:
        """Restarts of the time axis: clock_reanchored (counter, fitted clock), clock_set_back (time of receipt)."""
        reanchored = max(clock.reanchored for clock in self._stream.clocks)
        return {"clock_reanchored": reanchored, "clock_set_back": self._stream.pairing.set_back}

    @property
    def stamps(self) -> Stamps:
        """Jitter of the time stamps."""
        stream = self._stream
        if stream.clock == sampling.CYCLIC:
            return stamps_of(stream.meter, "cyclic", sampling.cyclic_interval_s(stream.clocks[1]))
        if stream.clock == sampling.COUNTER:
            counts = stream.clocks[0]
            fitted_s, counted_s = sampling.counted_interval_s(counts), sampling.time_per_count_s(counts)
            return stamps_of(stream.meter, "counter", fitted_s, counted_s)
        return stamps_of(stream.meter, "receipt")

    def take(self, decoded: Mapping[FrameKey, Decoded]) -> SampleBlock | None:
        """Take the messages of a block of frames; returns the samples that are now complete, or None."""
        parts = [self._values(key, decoded[key]) for key in self.keys if key in decoded]
        if not parts:
            return self._block(sampling.new_samples(self._stream, 0)[:0], decoded)
        values = parts[0]
        if len(parts) > 1:
            values = np.concatenate(parts)
            values = values[values["place"].argsort()]
        samples = sampling.new_samples(self._stream, len(values))
        return self._block(samples[: sampling.take_frames(self._stream, values, samples)], decoded)

    def _values(self, key: FrameKey, decoded: Decoded) -> NDArray[np.void]:
        """The values in the frames of a message."""
        values = np.zeros(len(decoded.places), sampling.FRAME)
        values["place"], values["received_us"] = decoded.places, decoded.t_us
        for quantity, name, bit in self._columns:
            if quantity.key == key:
                values[name], present = quantity.column(decoded.signals)
                values["has"] += np.uint8(bit) * present  # each bit is added once
        return values

    def flush(self) -> SampleBlock | None:
        """End the input: returns the samples of held values; values without a partner are counted as dropped."""
        samples = sampling.new_samples(self._stream, 0)
        return self._block(samples[: sampling.flush_frames(self._stream, samples)], {})

    def _block(self, samples: NDArray[np.void], decoded: Mapping[FrameKey, Decoded]) -> SampleBlock | None:
        """The samples with the auxiliary signals at the frames that completed them."""
        found = (*self.held, *self.coupled)
        held = [signal.take(decoded, samples["place"], samples["received_us"]) for signal in found]
        if not len(samples):
            return None
        t_us, torque, motion = (samples[name].copy() for name in ("t_us", "torque", "motion"))
        block = SampleBlock(t_us, torque, motion, signals=np.stack(held, axis=1) if held else None)
        paired = self._late.paired(block)
        return paired if paired.size else None
