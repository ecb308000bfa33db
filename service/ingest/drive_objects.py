"""What CANopen drives send of torque and motion, by their EDS; and which of them are on a bus."""

from pathlib import Path
from typing import NamedTuple

from service.can.canopen_drives import commissioned_node, node_name, object_name, read_drive, value_in
from service.can.frames import FrameBlock, FrameKey
from service.can.messages import DescriptionError, Message, find_signal, key_of_message
from service.config.canopen_axis import CURRENT, POSITION, TORQUE, VELOCITY

_NODE_BITS = 0x7F
"""Bits of a predefined identifier that are the node"""
_RATED = {TORQUE: 0x6076, CURRENT: 0x6075}
"""Objects that torque and current are thousandths of, in thousandths of N m and A"""
_ENCODER = 0x608F
"""Subindex 1: increments, 2: in so many turns"""


class DriveObjects(NamedTuple):
    """Objects that are torque and motion of a drive."""

    torque: int
    motion: int
    interval_s: float | None
    """Time between two SYNCs, if the file has it"""
    rated: float | None = None
    """Of the torque [N m] or the current [A], if the file has it"""
    counts_per_turn: float | None = None
    """Of the position, if the file has it"""
    others: tuple[str, ...] = ()
    """What else is sent, in words"""

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
    interval_s = message.cycle_time / 1000 if message.cycle_time else None
    rated, counts = (value_in(eds, node_id, *place) for place in ((_RATED[torque],), (_ENCODER, 1)))
    turns = value_in(eds, node_id, _ENCODER, 2) or 1
    return DriveObjects(
        torque,
        motion,
        interval_s,
        rated / 1000 if rated else None,
        counts / turns if counts else None,
        _others(eds, node_id, {object_name(torque), object_name(motion)}),
    )


def _others(eds: Path, node_id: int, used: set[str]) -> tuple[str, ...]:
    group = read_drive(eds, node_id).groups[node_name(node_id)]
    sent = dict.fromkeys(entry.name for message in group.messages for entry in message.signals)
    return tuple(f"{name} ({group.names.get(name, 'no name')})" for name in sent if name not in used)


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
    """The nodes whose torque is among these frames; of a DCF that was saved for one node only that.

    Raises:
        DescriptionError: as of ``objects_of``.
    """
    counts, own = frames.counts(), commissioned_node(eds)
    nodes = {key.can_id & _NODE_BITS for key in counts if not key.extended} - {0} if own is None else {own}
    found: dict[FrameKey, int] = {}
    for node_id in sorted(nodes):
        key = key_of_message(_first(eds, node_id, TORQUE, CURRENT)[1])
        # An identifier that the file gives as a number is the same for all nodes.
        if key in counts and (key not in found or key.can_id & _NODE_BITS == node_id):
            found[key] = node_id
    return sorted(found.values())
