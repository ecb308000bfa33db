"""Why a record has no samples of an axis: its numbers, or what a CAN log has in place of the messages of this axis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from monitor_core.samples import PHYSICAL_LIMITS
from service.can.frames import FrameKey, key_of
from service.can.messages import Message, MessageSet, find_signal, key_of_message
from service.config.bus_messages import messages_of
from service.config.schema import Config, NamedAxis
from service.config.unit_names import UNITS
from service.ingest.records import LogRecord, is_table


def why_none(path: Path, config: Config, axis: NamedAxis, dropped: Mapping[str, int]) -> str:
    """Why a record gives no samples of an axis, as far as it shows; else what was dropped.

    Raises:
        RecordError, DescriptionError, IngestError: as of LogRecord.
    """
    if dropped.get("absurd"):
        torque, motion = PHYSICAL_LIMITS["torque"], PHYSICAL_LIMITS[axis.config.output]
        unit = UNITS[axis.config.output]
        return (
            f"{dropped['absurd']} values are beyond {torque:g} N m or {motion:g} {unit}, more than any machine has; is"
            " the factor that makes them SI units missing, or wrong?"
        )
    if not is_table(path) and (words := absence_words(path, config, axis)):
        return words
    lost = ", ".join(f"{count} {reason}" for reason, count in dropped.items() if count)
    return f"dropped: {lost or 'nothing'}"


def absence_words(path: Path, config: Config, axis: NamedAxis) -> str:
    """What is wrong with the messages of an axis, by the frames in a log; empty: nothing that frames show.

    Raises:
        RecordError, DescriptionError, IngestError: as of LogRecord.
    """
    counts, longest = Counter[FrameKey](), dict[FrameKey, int]()
    for of_bus, _ in LogRecord(path, config, {axis.id: ()}).frames():
        if (frames := of_bus.get(axis.config.bus)) is None:
            continue
        counts.update(frames.counts())
        ids, places = np.unique(frames.ids, return_inverse=True)
        lengths = np.zeros(len(ids), np.int64)
        np.maximum.at(lengths, places, frames.lengths)
        for record_id, length in zip(ids.tolist(), lengths.tolist(), strict=True):
            key = key_of(record_id)
            longest[key] = max(longest.get(key, 0), length)
    known = messages_of(config, axis.config.bus)
    sources = axis.config.torque, axis.config.motion
    messages = [find_signal(known, source.message, source.signal)[0] for source in sources]
    words = (_wrong(known, message, counts, longest) for message in messages)
    return "; ".join(dict.fromkeys(word for word in words if word))


def _wrong(
    known: MessageSet, message: Message, counts: Counter[FrameKey], longest: Mapping[FrameKey, int]
) -> str:
    key, name = key_of_message(message), message.name
    came = {other: count for other, count in counts.items() if known.carries(key, other.record_id)}
    if came:
        length = max(longest[other] for other in came)
        if length >= message.length:
            return ""
        return f"{name} has {message.length} bytes by {known.source}, and its {sum(came.values())} frames {length}"
    twin = FrameKey(key.can_id, not key.extended)
    if counts[twin]:
        bits = {True: 29, False: 11}
        return (
            f"{name} has an identifier of {bits[key.extended]} bits by {known.source}, and {counts[twin]} frames have"
            f" 0x{key.can_id:X} with {bits[twin.extended]}"
        )
    return f"{name} (0x{key.can_id:X}) never came"
