"""Encodes values of axes to frames, the inverse of decoding; for play and simulate."""

import math
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import NamedTuple

from service.can.frames import FrameKey
from service.can.messages import CodingError, Message, Signal
from service.can.user_errors import IngestError
from service.config.schema import Config
from service.ingest.samples.arm_motions import ArmMotions
from service.ingest.samples.axis_input import AxisInput
from service.ingest.samples.bus_samples import Ingest
from service.ingest.samples.quantities import AxisQuantity

Raw = dict[str, int | float]
Page = tuple[tuple[str, int], ...]
SampleValues = tuple[float, float] | tuple[float, float, tuple[float, ...]]
"""Torque [N m], motion [rad or rad/s], and the auxiliary signals of the axis, if known."""

_QuantityRaw = tuple[AxisQuantity, int | float]


class Encoded(NamedTuple):
    """A frame to send."""

    key: FrameKey
    data: bytes


class FrameEncoder:
    """Encodes frames of one bus from torque, motion and auxiliary signals of its axes.

    The motion is that of the motor; where axes are coupled, that of the arm is sent, as controllers do.
    Signals that no axis needs get their initial value, or the raw value 0.

    Raises:
        DescriptionError: the configuration cannot be used.
    """

    def __init__(self, config: Config, bus: str) -> None:
        ingest = Ingest(config, bus)
        self._axes = ingest.axes
        self._messages = ingest.decoder.messages
        self._arm = ArmMotions(axis for axis in config.axes if axis.id in self._axes)
        # An auxiliary signal that is the torque or motion of another axis is sent with that axis.
        own = {(q.key, q.signal) for axis in self._axes.values() for q in axis.sampled}
        self._further = {
            axis.id: [None if (h.quantity.key, h.quantity.signal) in own else h.quantity for h in axis.held]
            for axis in self._axes.values()
        }

    def encode(self, values: Mapping[str, SampleValues], count: int) -> list[Encoded]:
        """The frames of one sample: first the auxiliary signals, then torque and motion.

        ``values``: by axis; axes of other buses are ignored.  ``count``: value of the sample counters; it wraps.

        Raises:
            IngestError: a value does not fit into its signal.
        """
        messages: dict[FrameKey, dict[Page, Raw]] = {}
        mine = {axis_id: of_axis for axis_id, of_axis in values.items() if axis_id in self._axes}
        raws = [self._auxiliary(axis_id, *of_axis[2:3]) for axis_id, of_axis in mine.items()]
        motions = self._arm.take({axis_id: v[1] for axis_id, v in mine.items()})
        raws += [self._raws(self._axes[axis_id], count, v[0], motions[axis_id]) for axis_id, v in mine.items()]
        for quantity, raw in chain.from_iterable(raws):
            page = _page(self._messages[quantity.key], self._signal(quantity))
            messages.setdefault(quantity.key, {}).setdefault(page, {})[quantity.signal] = raw
        return [Encoded(key, data) for key, pages in messages.items() for data in _data(self._messages[key], pages)]

    def _auxiliary(self, axis_id: str, signals: tuple[float, ...] = ()) -> Iterator[_QuantityRaw]:
        for quantity, value in zip(self._further[axis_id], signals, strict=False):
            if quantity is not None and math.isfinite(value):
                yield quantity, self._raw(axis_id, quantity, value)

    def _raws(self, axis: AxisInput, count: int, torque: float, motion: float) -> Iterator[_QuantityRaw]:
        for quantity, value in ((axis.torque, torque), (axis.motion, motion)):
            yield quantity, self._raw(axis.id, quantity, value)
        if axis.counter is not None:
            signal = self._signal(axis.counter)
            raw = count % (1 << signal.length)
            negative = signal.is_signed and raw >> (signal.length - 1)
            yield axis.counter, raw - (1 << signal.length) if negative else raw

    def _raw(self, axis_id: str, quantity: AxisQuantity, value: float) -> int | float:
        signal = self._signal(quantity)
        raw = signal.scaled_to_raw(_wrapped((value - quantity.offset) / quantity.factor, quantity, signal))
        if signal.is_float:
            return raw
        lowest = -(1 << (signal.length - 1)) if signal.is_signed else 0
        if not lowest <= raw < lowest + (1 << signal.length):
            raise IngestError(
                f"axis {axis_id}: the {quantity.name} {value:g} does not fit into signal {signal.name} of "
                f"{quantity.message}, {signal.length} bits of {signal.scale:g}"
            )
        return raw

    def _signal(self, quantity: AxisQuantity) -> Signal:
        return self._messages[quantity.key].get_signal_by_name(quantity.signal)


def _wrapped(value: float, quantity: AxisQuantity, signal: Signal) -> float:
    """An angle wrapped into its period, which starts at zero, or at minus half a period for a signed signal."""
    if quantity.wrap_period is None:
        return value
    lowest = -quantity.wrap_period / 2 if signal.is_signed else 0.0
    return (value - lowest) % quantity.wrap_period + lowest


def _page(message: Message, signal: Signal) -> Page:
    """The multiplexers that select this signal, with their raw values."""
    page: list[tuple[str, int]] = []
    while signal.multiplexer_signal is not None and signal.multiplexer_ids:
        page.append((signal.multiplexer_signal, signal.multiplexer_ids[0]))
        signal = message.get_signal_by_name(signal.multiplexer_signal)
    return tuple(page)


def _data(message: Message, pages: Mapping[Page, Raw]) -> Iterator[bytes]:
    """The data of a frame for each page; signals without a page are in all frames."""
    common: Raw = {signal.name: signal.raw_initial or 0 for signal in message.signals} | pages.get((), {})
    for page in [page for page in pages if page] or [()]:
        try:
            yield message.encode({**common, **dict(page), **pages[page]}, scaling=False, strict=False)
        except CodingError as error:
            raise IngestError(f"message {message.name} cannot be encoded: {error}") from None
