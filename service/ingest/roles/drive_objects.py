"""Finds the torque and motion objects that CANopen drives send, by their EDS, and the drives on a bus."""

from pathlib import Path
from typing import NamedTuple

from service.can.canopen_drives import commissioned_node, node_name, object_name, read_drive, value_in
from service.can.frames import FrameBlock, FrameKey
from service.can.messages import DescriptionError, Message, find_signal, key_of_message
from service.config.schema.canopen_axis import CURRENT, POSITION, TORQUE, VELOCITY

_NODE_BITS = 0x7F
"""Bits of the node id in a predefined identifier"""
_RATED = {TORQUE: 0x6076, CURRENT: 0x6075}
"""Objects with the rated torque [mN m] and rated current [mA]; torque and current are in thousandths of these"""
_ENCODER = 0x608F
"""Encoder resolution: subindex 1 has the increments, subindex 2 the turns that they belong to"""


class DriveObjects(NamedTuple):
    """The objects with torque and motion of a drive."""

    torque: int
    motion: int
    interval_s: float | None
    """Interval of the SYNC; None: not in the file"""
    rated: float | None = None
    """Rated torque [N m] or current [A]; None: not in the file"""
    counts_per_turn: float | None = None
    """Counts of the position per turn; None: not in the file"""
    others: tuple[str, ...] = ()
    """Other objects that the drive sends, in words"""

    def __str__(self) -> str:
        torque = "torque" if self.torque == TORQUE else "current"
        motion = "position" if self.motion == POSITION else "velocity"
        return f"{torque} {object_name(self.torque)}, {motion} {object_name(self.motion)}"


def objects_of(eds: Path, node_id: int) -> DriveObjects:
    """The objects of a drive; torque is preferred to current, and position to velocity.

    Raises:
        DescriptionError: the file cannot be used, or the drive does not send these objects.
    """
    torque, message = _find_object(eds, node_id, TORQUE, CURRENT)
    motion, _ = _find_object(eds, node_id, POSITION, VELOCITY)
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


def _find_object(eds: Path, node_id: int, preferred: int, other: int) -> tuple[int, Message]:
    known, name = read_drive(eds, node_id), node_name(node_id)
    try:
        return preferred, find_signal(known, name, object_name(preferred))[0]
    except DescriptionError as missing:
        try:
            return other, find_signal(known, name, object_name(other))[0]
        except DescriptionError:
            raise missing from None


def nodes_in(eds: Path, frames: FrameBlock) -> list[int]:
    """The nodes whose torque is among these frames.  A DCF that was saved for one node can only give that node.

    Raises:
        DescriptionError: as of ``objects_of``.
    """
    counts, own = frames.counts(), commissioned_node(eds)
    nodes = {key.can_id & _NODE_BITS for key in counts if not key.extended} - {0} if own is None else {own}
    found: dict[FrameKey, int] = {}
    for node_id in sorted(nodes):
        key = key_of_message(_find_object(eds, node_id, TORQUE, CURRENT)[1])
        # An identifier that the file states as a number is the same for all nodes.
        if key in counts and (key not in found or key.can_id & _NODE_BITS == node_id):
            found[key] = node_id
    return sorted(found.values())
