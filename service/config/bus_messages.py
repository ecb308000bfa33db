"""All messages of a bus: those of its file, and those of the table in the configuration."""

from __future__ import annotations

from collections.abc import Iterator

from service.can.frames import FrameKey
from service.can.message_files import read_messages
from service.can.messages import Bits, DescriptionError, MessageSet, message_of
from service.config.schema import BitsConfig, BusConfig, MessageConfig


def messages_of(bus: BusConfig) -> MessageSet:
    """The messages of a bus.

    Raises:
        DescriptionError: its file cannot be used, or nothing describes them.
    """
    parts = tuple(_parts(bus))
    if not parts:
        raise DescriptionError(f"nothing describes the messages of bus {bus.name}")
    messages = tuple(message for part in parts for message in part.messages)
    return MessageSet(messages, " and ".join(part.source for part in parts))


def _parts(bus: BusConfig) -> Iterator[MessageSet]:
    if bus.messages is not None:
        yield read_messages(bus.messages)
    if bus.message:
        yield MessageSet(
            tuple(message_of(m.name, _key(m), [*map(bits_of, m.signal)]) for m in bus.message),
            "[[bus.message]]",
        )


def _key(message: MessageConfig) -> FrameKey:
    return FrameKey(message.id, message.is_extended)


def bits_of(s: BitsConfig) -> Bits:
    """The signal of a table."""
    return Bits(s.name, s.start_bit, s.length, s.kind, s.byte_order, s.factor, s.offset)
