"""The messages of a bus, described by a file, by a table in the configuration, or by CANopen drives.

Every description is converted to the messages and signals of cantools, and all other code uses only these.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.errors import Error as CodingError

from monitor_core.wording import did_you_mean, listed
from service.can.frames import EXTENDED, ID_BITS, FrameKey

__all__ = ["CodingError", "DescriptionError", "Message", "MessageSet", "Signal"]


class DescriptionError(Exception):
    """A description cannot be used or lacks a name; the text is for the user.

    ``signal``: the name of the signal is wrong, and that of the message is right.
    """

    def __init__(self, text: str, signal: bool = False) -> None:
        super().__init__(text)
        self.signal = signal


class MessageGroup(NamedTuple):
    """Messages with a common name; a signal is found by this name, whichever message has it."""

    messages: tuple[Message, ...]
    faults: Mapping[str, str]
    """Signals that are not sent: why, and how to correct that"""
    fault: str
    """The same for all signals that are not in ``faults``"""
    names: Mapping[str, str]
    """Readable names of signals, if known"""


class MessageSet(NamedTuple):
    """The messages of a bus.

    Faults in unused messages are ignored; ``find_signal`` checks the ones that are used.
    """

    messages: tuple[Message, ...]
    source: str
    """Name of the description, e.g. "robot.dbc" """
    groups: Mapping[str, MessageGroup] = MappingProxyType({})
    """Groups of messages by name"""
    sync: Mapping[FrameKey, FrameKey] = MappingProxyType({})
    """Messages with values sampled at a SYNC, and the key of that SYNC"""
    masks: Mapping[FrameKey, int] = MappingProxyType({})
    """Messages that are identified by these bits of the identifier only; for all others, all bits count"""

    def mask(self, key: FrameKey) -> int:
        """The bits of a record's id that identify a message."""
        return self.masks.get(key, ID_BITS) | EXTENDED

    def carries(self, key: FrameKey, record_id: int) -> bool:
        """Whether a frame with this id in its record carries a message."""
        return (record_id ^ key.record_id) & self.mask(key) == 0

    def counted(self, frames: Mapping[FrameKey, int]) -> dict[FrameKey, int]:
        """Number of frames of each message, from numbers of frames by their own ids."""
        return {
            key: sum(count for own, count in frames.items() if self.carries(key, own.record_id))
            for key in map(key_of_message, self.messages)
        }


def read_unchanged(read: Callable[..., MessageSet], path: Path, what: str | int) -> MessageSet:
    """Call a cached function that reads a file; it reads the file again if this has changed.

    ``what``: further argument of the function.

    Raises:
        DescriptionError: the file cannot be read.
    """
    try:
        state = path.stat()
        return read(path, what, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise DescriptionError(f"cannot read {path}: {error.strerror}") from None


def text_in(data: bytes) -> str:
    """The text of a file."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:  # most tools write the Western code page
        return data.decode("cp1252", errors="replace")


def united(parts: Sequence[MessageSet]) -> MessageSet:
    """The messages of several descriptions of one bus."""
    return MessageSet(
        tuple(message for part in parts for message in part.messages),
        " and ".join(dict.fromkeys(part.source for part in parts)),
        {name: group for part in parts for name, group in part.groups.items()},
        {key: sync for part in parts for key, sync in part.sync.items()},
        {key: mask for part in parts for key, mask in part.masks.items()},
    )


NumberKind = Literal["unsigned", "signed", "float"]
ByteOrder = Literal["little", "big"]


class Bits(NamedTuple):
    """A signal as described in a configuration: position of its bits; value = factor * number + offset."""

    name: str
    start_bit: int
    """The lowest bit, or the highest one in big endian: 8 * byte + bit, where bit 0 is the lowest of a byte"""
    length: int
    kind: NumberKind = "unsigned"
    byte_order: ByteOrder = "little"
    factor: float = 1.0
    offset: float = 0.0

    @property
    def bytes_needed(self) -> int:
        """Bytes that a message needs for the signal to fit."""
        if self.byte_order == "little":
            return (self.start_bit + self.length + 7) // 8
        return self.start_bit // 8 + (self.length + 7 - self.start_bit % 8 + 7) // 8


def message_of(name: str, key: FrameKey, signals: Sequence[Bits]) -> Message:
    """Make a message with these signals and the length that they need.

    Raises:
        DescriptionError: the identifier has too many bits.
    """
    found = [
        Signal(
            bits.name,
            bits.start_bit,
            bits.length,
            byte_order="little_endian" if bits.byte_order == "little" else "big_endian",
            is_signed=bits.kind == "signed",
            conversion=BaseConversion.factory(bits.factor, bits.offset, None, bits.kind == "float"),
        )
        for bits in signals
    ]
    length = max(bits.bytes_needed for bits in signals)
    try:
        return Message(key.can_id, name, length, found, is_extended_frame=key.extended, strict=False)
    except CodingError as error:
        raise DescriptionError(str(error)) from None


def key_of_message(message: Message) -> FrameKey:
    """The key of the frames that carry a message."""
    return FrameKey(message.frame_id, message.is_extended_frame)


def find_signal(known: MessageSet, message: str, signal: str) -> tuple[Message, Signal]:
    """Find a message and its signal by their names.

    Raises:
        DescriptionError: it does not exist, the signals do not fit into the message, or another message has its
            identifier.
    """
    if message in known.groups:
        return _find_in(known, message, signal)
    found = _message(known, message)
    by_name = {entry.name: entry for entry in found.signals}
    if signal not in by_name:
        hint = did_you_mean(signal, by_name)
        raise DescriptionError(f'no signal "{signal}" in message {found.name}: {hint}', signal=True)
    return found, by_name[signal]


def _find_in(known: MessageSet, name: str, signal: str) -> tuple[Message, Signal]:
    group = known.groups[name]
    for message in group.messages:
        if any(entry.name == signal for entry in message.signals):
            return find_signal(known, message.name, signal)
    sent = dict.fromkeys(entry.name for message in group.messages for entry in message.signals)
    named = {entry: f"{entry} ({group.names[entry]})" if entry in group.names else entry for entry in (signal, *sent)}
    sends = listed([named[entry] for entry in sent]) or "nothing"
    fault = group.faults.get(signal, group.fault)
    raise DescriptionError(f"{name} does not send {named[signal]}: {fault}; it sends {sends}", signal=True)


def _message(known: MessageSet, name: str) -> Message:
    by_name = {message.name: message for message in known.messages}
    if name not in by_name:
        raise DescriptionError(
            f'no message "{name}" in {known.source}: {did_you_mean(name, [*by_name, *known.groups])}'
        )
    message = by_name[name]
    try:
        message.refresh(strict=True)
    except CodingError as error:
        raise DescriptionError(f"{known.source} is wrong about this message: {error}") from None
    key = key_of_message(message)
    alike = known.messages if known.masks else [m for m in known.messages if m.frame_id == message.frame_id]
    for other in alike:
        own = key_of_message(other)
        if other is not message and (own.record_id ^ key.record_id) & known.mask(key) & known.mask(own) == 0:
            raise DescriptionError(f"{known.source} gives its identifier {message.frame_id:#x} to {other.name}, too")
    return message


def find_counter(known: MessageSet, message: str, signal: str) -> tuple[Message, Signal]:
    """Find a message and its sample counter by their names.

    Raises:
        DescriptionError: it does not exist, or is no integer with factor 1.
    """
    owner, counter = find_signal(known, message, signal)
    if counter.is_float or counter.scale != 1:
        found = "a float" if counter.is_float else f"an integer with factor {counter.scale:g}"
        text = f"a sample counter must be an integer with factor 1; in {known.source} {signal} is {found}"
        raise DescriptionError(text, signal=True)
    return owner, counter
