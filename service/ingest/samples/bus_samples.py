"""Makes blocks of samples of the axes from blocks of frames of one bus; the same code for daemon and replay."""

from collections.abc import Iterator, Mapping, Sequence, Set
from typing import NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.samples import SampleBlock
from service.can.decoder import Decoded, Decoder
from service.can.frames import ID_BITS, FrameBlock, FrameFilter, FrameKey
from service.config.bus_messages import messages_of
from service.config.conditions import needed
from service.config.schema import Config, FurtherSignalConfig, NamedAxis
from service.ingest.samples.axis_input import AxisInput

Carried = Mapping[str, Sequence[FurtherSignalConfig]]
"""By axis: the auxiliary signals of its samples.  Axes that are not in it are not read."""


def carried_by(config: Config) -> Carried:
    """The auxiliary signals that the monitoring of each axis needs."""
    return {axis.id: needed(axis) for axis in config.axes}


class QuantityValues(NamedTuple):
    """The decoded values of one quantity before pairing, in order of receipt."""

    axis_id: str
    quantity: str  # "torque", "angle", "speed", "counter" or "signal NAME"
    message: str
    signal: str
    t_us: Ints
    """Times of receipt (N,)"""
    physical: Floats
    """Values (N,) in the unit of the bus description"""
    si: Floats
    """Values (N,) in N m, rad or rad/s on the motor side; an auxiliary signal in its own unit"""


class Ingest:
    """Ingest of the axes of one bus; ``carried``: auxiliary signals by axis; None: those that the monitoring needs.

    Raises:
        DescriptionError: the messages of the bus cannot be read, or it has no such message or signal.
    """

    def __init__(self, config: Config, bus: str, carried: Carried | None = None) -> None:
        signals = carried_by(config) if carried is None else carried
        axes = [axis for axis in config.axes if axis.config.bus == bus and axis.id in signals]
        self.decoder = Decoder(messages_of(config, bus))
        self.axes = {axis.id: AxisInput(axis, self.decoder, signals[axis.id]) for axis in axes}
        """The axes on this bus, by id"""

    def change(self, axes: Sequence[NamedAxis], replaced: Set[str]) -> None:
        """Read exactly these axes from now on.  Axes in ``replaced`` get a new input; the others keep theirs.

        Raises:
            DescriptionError: as the constructor.
        """
        self.axes = {
            axis.id: AxisInput(axis, self.decoder, needed(axis)) if axis.id in replaced else self.axes[axis.id]
            for axis in axes
        }

    @property
    def filter(self) -> tuple[FrameFilter, ...]:
        """The filters that let all needed frames through."""
        masks = self.decoder.known.masks
        return tuple(FrameFilter(key, masks.get(key, ID_BITS)) for key in self.decoder.keys)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Number of frames that gave no value, or not all values, by reason (service.can.decoder.FRAME_REASONS)."""
        return dict(self.decoder.dropped)

    def feed(self, frames: FrameBlock) -> dict[str, SampleBlock]:
        """Take frames; returns the samples that they complete, by axis, in the order of their times."""
        return self._samples(self.decoder.decode(frames))

    def feed_values(self, frames: FrameBlock) -> Iterator[QuantityValues]:
        """The decoded values of these frames, to inspect a bus.  Counts, pairs and measures times like ``feed``."""
        decoded = self.decoder.decode(frames)
        self._samples(decoded)
        for axis in self.axes.values():
            for q in (*axis.sampled, *(held.quantity for held in axis.held)):
                if (found := decoded.get(q.key)) is None:
                    continue
                raw, (si, there) = found.signals[q.signal], q.column(found.signals)
                if there.any():
                    t_us = found.t_us[there]
                    yield QuantityValues(axis.id, q.name, q.message, q.signal, t_us, raw.values[there], si[there])

    def flush(self) -> dict[str, SampleBlock]:
        """End the input: returns samples that were held; values without a partner are counted as dropped."""
        flushed = {axis_id: axis.flush() for axis_id, axis in self.axes.items()}
        return {axis_id: samples for axis_id, samples in flushed.items() if samples is not None}

    def _samples(self, decoded: Mapping[FrameKey, Decoded]) -> dict[str, SampleBlock]:
        found = {axis_id: axis.take(decoded) for axis_id, axis in self.axes.items()}
        return {axis_id: samples for axis_id, samples in found.items() if samples is not None}
