"""All messages of a bus: from its description file, the table in the configuration, and the CANopen drives."""

from collections.abc import Iterator
from pathlib import Path

from service.can.canopen_drives import node_of, read_drive
from service.can.frames import FrameKey
from service.can.message_files import read_messages
from service.can.messages import Bits, DescriptionError, MessageSet, message_of, united
from service.config.schema import BitsConfig, Config, MessageConfig

_FIRST_BROADCAST = 240
"""J1939 parameter groups with a smaller second byte are sent to a destination."""
_PRIORITY = 6
"""Default J1939 priority, for frames that are sent"""


def messages_of(config: Config, bus: str) -> MessageSet:
    """The messages of the bus with this name.  They are made at each call, so callers should keep them.

    Raises:
        DescriptionError: a file cannot be used, or nothing describes the messages.
    """
    parts = tuple(_parts(config, bus))
    if not parts:
        raise DescriptionError(f"nothing describes the messages of bus {bus}")
    return united(parts)


FileVersions = frozenset[tuple[Path, int, int]]
"""Files with the times of their last change [ns] and their sizes"""


def files_of(config: Config, bus: str) -> FileVersions:
    """The files that describe the messages of a bus.

    Raises:
        OSError: a file does not exist.
    """
    axes = [axis for robot in config.robot for axis in robot.axis if axis.bus == bus]
    files = {axis.canopen.eds for axis in axes if axis.canopen is not None}
    files |= {own.messages for own in config.bus if own.name == bus and own.messages is not None}
    return frozenset((file, file.stat().st_mtime_ns, file.stat().st_size) for file in files)


def _parts(config: Config, name: str) -> Iterator[MessageSet]:
    for bus in config.bus:
        if bus.name == name and bus.messages is not None:
            yield read_messages(bus.messages)
        if bus.name == name and bus.message:
            masks = {_key(m): _mask(m) for m in bus.message if m.pgn is not None}
            known = (message_of(m.name, _key(m), [*map(bits_of, m.signal)]) for m in bus.message)
            yield MessageSet(tuple(known), "[[bus.message]]", masks=masks)
    axes = [axis for robot in config.robot for axis in robot.axis if axis.bus == name]
    drives = {axis.canopen.node_id: axis.canopen.eds for axis in axes if axis.canopen is not None}
    for axis in axes:
        if axis.canopen is not None:  # a node that belongs to no axis is taken as a drive of the same kind
            nodes = (node_of(signal.message or "") for signal in axis.signal)
            drives = {node_id: axis.canopen.eds for node_id in nodes if node_id is not None} | drives
    for node_id, eds in sorted(drives.items()):
        yield read_drive(eds, node_id)


def is_addressed(pgn: int) -> bool:
    """Whether a J1939 parameter group is sent to a destination, which is then part of the identifier (PDU1)."""
    return pgn >> 8 & 0xFF < _FIRST_BROADCAST


def _key(message: MessageConfig) -> FrameKey:
    if message.pgn is None:
        return FrameKey(message.id or 0, message.is_extended)
    destination = 0xFF if is_addressed(message.pgn) else 0  # to all
    return FrameKey(_PRIORITY << 26 | message.pgn << 8 | destination << 8 | (message.source_address or 0), True)


def _mask(message: MessageConfig) -> int:
    """The bits of the identifier that identify the message."""
    group = 0x3FF0000 if is_addressed(message.pgn or 0) else 0x3FFFF00
    return group | (0 if message.source_address is None else 0xFF)


def bits_of(s: BitsConfig) -> Bits:
    """The signal that a table describes."""
    return Bits(s.name, s.start_bit, s.length, s.kind, s.byte_order, s.factor, s.offset)
