"""All messages of a bus: those of its file, of the table in the configuration, and of the drives of its axes."""

from __future__ import annotations

from collections.abc import Iterator

from service.can.canopen_drives import node_of, read_drive
from service.can.frames import FrameKey
from service.can.message_files import read_messages
from service.can.messages import Bits, DescriptionError, Message, MessageSet, message_of, united
from service.config.schema import BitsConfig, Config, MessageConfig


def messages_of(config: Config, bus: str) -> MessageSet:
    """The messages of the bus of that name.

    Raises:
        DescriptionError: a file cannot be used, or nothing describes them.
    """
    parts = tuple(_parts(config, bus))
    if not parts:
        raise DescriptionError(f"nothing describes the messages of bus {bus}")
    return united(parts)


def _parts(config: Config, name: str) -> Iterator[MessageSet]:
    for bus in config.bus:
        if bus.name == name and bus.messages is not None:
            yield read_messages(bus.messages)
        if bus.name == name and bus.message:
            yield MessageSet(tuple(map(_message, bus.message)), "[[bus.message]]")
    axes = [axis for robot in config.robot for axis in robot.axis if axis.bus == name]
    drives = {axis.canopen.node_id: axis.canopen.eds for axis in axes if axis.canopen is not None}
    for axis in axes:
        if axis.canopen is not None:  # a drive of no axis is one of the same kind
            nodes = (node_of(signal.message or "") for signal in axis.signal)
            drives = {node_id: axis.canopen.eds for node_id in nodes if node_id is not None} | drives
    for node_id, eds in sorted(drives.items()):
        yield read_drive(eds, node_id)


def _message(message: MessageConfig) -> Message:
    return message_of(
        message.name, FrameKey(message.id, message.is_extended), [*map(bits_of, message.signal)]
    )


def bits_of(s: BitsConfig) -> Bits:
    """The signal of a table."""
    return Bits(s.name, s.start_bit, s.length, s.kind, s.byte_order, s.factor, s.offset)
