"""Finds the numbers in the messages of an undescribed bus, and which of them are torque and motion."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from service.can.frames import FrameBlock, FrameKey
from service.can.inferred_layout import FEWEST_FRAMES, Field, find_multiplexer, infer_layout
from service.can.messages import Bits, MessageSet, NumberKind, message_of
from service.ingest.roles.live_roles import roles_on_bus
from service.ingest.roles.signal_roles import AxisRoles

_FEWEST_VALUES, _CHANGES = 16, 0.2
"""A number may be torque or motion if it has at least this many different values, and changes in more than this share
of the frames"""


_LETTERS = "abcdefgh"


class UnknownMessage(NamedTuple):
    """The frames with one identifier."""

    key: FrameKey
    rate: float
    """Frames per second, measured over the middle half of the frames"""
    length: int
    """Length of most frames in bytes"""
    fields: tuple[Field, ...] = ()
    """The numbers in the message; none if too few frames were received, or if the message is multiplexed"""
    bits: tuple[Bits, ...] = ()
    """The counters and the changing numbers, as a configuration describes them"""
    pages: int = 0
    """Number of values of the ``multiplexer`` byte; 0: the message is not multiplexed"""
    multiplexer: int | None = None

    @property
    def name(self) -> str:
        """Name of the message in the proposed configuration."""
        return f"x{self.key.can_id:x}"


class Discovered(NamedTuple):
    """The messages and axes found on an undescribed bus."""

    messages: tuple[UnknownMessage, ...]
    axes: tuple[AxisRoles, ...]


def discover_axes(frames: FrameBlock) -> Discovered:
    """Find the axes on an undescribed bus, from all its frames in order of receipt."""
    frames = frames.in_order()
    ids, places, counts = np.unique(frames.ids, return_inverse=True, return_counts=True)
    order = np.argsort(places, kind="stable")
    own = np.split(order, np.cumsum(counts)[:-1])
    messages = tuple(_message(frames.select(part)) for part in own if ids.size)
    described = [message_of(m.name, m.key, m.bits) for m in messages if m.bits]
    found = roles_on_bus(MessageSet(tuple(described), "the frames"), frames).axes
    axes = tuple(axis._replace(name=f"axis{number}") for number, axis in enumerate(found, 1))
    return Discovered(messages, axes)


def _message(frames: FrameBlock) -> UnknownMessage:
    (key,) = frames.counts()
    length = int(np.bincount(frames.lengths).argmax())
    data = frames.select(frames.lengths == length).data[:, :length]
    found = UnknownMessage(key, _rate(frames), length)
    if data.shape[0] < FEWEST_FRAMES or not length:
        return found
    fields = infer_layout(data)
    if (multiplexer := find_multiplexer(data, fields)) is not None:
        return found._replace(multiplexer=multiplexer, pages=np.unique(data[:, multiplexer]).size)
    moving = (f for f in fields if f.kind == "counter" or (f.kind == "signal" and _moves(f.values(data))))
    return found._replace(fields=fields, bits=tuple(map(_bits, moving)))


def _moves(values: Floats) -> bool:
    """Whether a number may be torque or motion of a moving axis, rather than a setting or noise of an idle drive."""
    return np.unique(values).size >= _FEWEST_VALUES and float(np.mean(np.diff(values) != 0)) > _CHANGES


def _rate(frames: FrameBlock) -> float:
    quarter = frames.size // 4
    t = frames.t_us[quarter : frames.size - quarter]
    span_s = float(t[-1] - t[0]) / 1e6
    return (t.size - 1) / span_s if span_s > 0 else 0.0


def _bits(field: Field) -> Bits:
    """The field as a configuration describes it.

    Its name has letters for the first bit: a digit would be taken for an axis number, and an "i" for a current.
    """
    what = "counter" if field.kind == "counter" else "value"
    kind: NumberKind = "float" if field.is_float else "signed" if field.is_signed else "unsigned"
    low = 0 if field.part is None else field.part.low_bit
    before = 8 * field.width - low - field.length if field.byte_order == "big" else low
    start_bit = 8 * field.first_byte + (7 - before if field.byte_order == "big" else before)
    high, last = divmod(field.first_byte, 8)
    letters = (f"x{_LETTERS[high]}" if high else "") + _LETTERS[last] + (_LETTERS[before] if before else "")
    return Bits(f"{what}_{letters}", start_bit, field.length, kind, field.byte_order)


def used_messages(found: Discovered) -> Sequence[UnknownMessage]:
    """The messages that carry the axes."""
    names = {role.message for axis in found.axes for role in (axis.torque, axis.motion)}
    return [message for message in found.messages if message.name in names]
