"""What CANopen drives send of torque and motion, by their EDS; and which of them are on a bus."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from service.can.canopen_drives import node_name, object_name, read_drive
from service.can.frames import FrameBlock
from service.can.messages import DescriptionError, Message, find_signal, key_of_message
from service.config.canopen_axis import CURRENT, POSITION, TORQUE, VELOCITY

_NODE_BITS = 0x7F
"""Of an identifier of the predefined ones"""


class DriveObjects(NamedTuple):
    """Objects that are torque and motion of a drive."""

    torque: int
    motion: int
    interval_s: float | None
    """Time between two SYNCs, if the file has it"""

    def __str__(self) -> str:
        torque = "torque" if self.torque == TORQUE else "current"
        motion = "position" if self.motion == POSITION else "velocity"
        return f"{torque} {object_name(self.torque)}, {motion} {object_name(self.motion)}"


def objects_of(eds: Path, node_id: int) -> DriveObjects:
    """Torque before current, and position before velocity.

    Raises:
        DescriptionError: the file cannot be used, or the drive does not send them.
    """
    torque, message = _first(eds, node_id, TORQUE, CURRENT)
    motion, _ = _first(eds, node_id, POSITION, VELOCITY)
    return DriveObjects(torque, motion, message.cycle_time / 1000 if message.cycle_time else None)


def _first(eds: Path, node_id: int, better: int, other: int) -> tuple[int, Message]:
    known, name = read_drive(eds, node_id), node_name(node_id)
    try:
        return better, find_signal(known, name, object_name(better))[0]
    except DescriptionError as missing:
        try:
            return other, find_signal(known, name, object_name(other))[0]
        except DescriptionError:
            raise missing from None


def nodes_in(eds: Path, frames: FrameBlock) -> list[int]:
    """The nodes whose torque is among these frames.

    Raises:
        DescriptionError: as of ``objects_of``.
    """
    counts = frames.counts()
    found = []
    for node_id in sorted({key.can_id & _NODE_BITS for key in counts if not key.extended} - {0}):
        _, message = _first(eds, node_id, TORQUE, CURRENT)
        if key_of_message(message) in counts:
            found.append(node_id)
    return found
