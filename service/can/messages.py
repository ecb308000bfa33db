"""The messages of a bus, whatever describes them: a file, a table in the configuration, drives that speak CANopen.

Every description is brought into one shape, the messages and signals of cantools.  Whatever decodes, encodes or
looks at a bus reads this shape only.
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
    """A description that cannot be used, or a name that it does not have, in words for the user.

    ``signal``: what is wrong is the name of the signal, and that of the message is right.
    """

    def __init__(self, text: str, signal: bool = False) -> None:
        super().__init__(text)
        self.signal = signal


class MessageGroup(NamedTuple):
    """Messages whose signals are found under one name, whichever message has them."""

    messages: tuple[Message, ...]
    faults: Mapping[str, str]
    """Of signals that are not sent: why, and what would be right"""
    fault: str
    """Of all other signals"""
    names: Mapping[str, str]
    """What signals are, where it is known"""


class MessageSet(NamedTuple):
    """The messages of a bus.

    Faults in unused messages are ignored; ``find_signal`` checks the ones that are used.
    """

    messages: tuple[Message, ...]
    source: str
    """What describes them, as in "robot.dbc" """
    groups: Mapping[str, MessageGroup] = MappingProxyType({})
    """By their names"""
    sync: Mapping[FrameKey, FrameKey] = MappingProxyType({})
    """Messages whose values are sampled at a SYNC, and the frames of that"""
    masks: Mapping[FrameKey, int] = MappingProxyType({})
    """Messages of which only these bits of the identifier count; of the others all do"""

    def mask(self, key: FrameKey) -> int:
        """The bits of the id in a record that count for a message."""
        return self.masks.get(key, ID_BITS) | EXTENDED

    def carries(self, key: FrameKey, record_id: int) -> bool:
        """Whether a frame with that id in its record carries a message."""
        return (record_id ^ key.record_id) & self.mask(key) == 0

    def counted(self, frames: Mapping[FrameKey, int]) -> dict[FrameKey, int]:
        """How many frames there are of each message, of frames counted by their own ids."""
        return {
            key: sum(count for own, count in frames.items() if self.carries(key, own.record_id))
            for key in map(key_of_message, self.messages)
        }


def read_unchanged(read: Callable[..., MessageSet], path: Path, what: str | int) -> MessageSet:
    """What a cached function reads of a file, by its arguments; it reads again once the file has changed.

    Raises:
        DescriptionError: the file cannot be read.
    """
    try:
        state = path.stat()
        return read(path, what, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise DescriptionError(f"cannot read {path}: {error.strerror}") from None


def text_in(data: bytes) -> str:
    """The text in a file."""
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


Kind = Literal["unsigned", "signed", "float"]
ByteOrder = Literal["little", "big"]


class Bits(NamedTuple):
    """A signal as a table of ids has it: where its bits are, and value = factor * number + offset."""

    name: str
    start_bit: int
    """The lowest bit, in big endian the highest; 8 * byte + bit, where bit 0 of a byte is its lowest"""
    length: int
    kind: Kind = "unsigned"
    byte_order: ByteOrder = "little"
    factor: float = 1.0
    offset: float = 0.0

    @property
    def bytes_needed(self) -> int:
        """Of the message, so that the signal fits."""
        if self.byte_order == "little":
            return (self.start_bit + self.length + 7) // 8
        return self.start_bit // 8 + (self.length + 7 - self.start_bit % 8 + 7) // 8


def message_of(name: str, key: FrameKey, signals: Sequence[Bits]) -> Message:
    """The message with these signals, as long as they need.

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
    """The frames that carry a message."""
    return FrameKey(message.frame_id, message.is_extended_frame)


def find_signal(known: MessageSet, message: str, signal: str) -> tuple[Message, Signal]:
    """A signal, after its message, by their names.

    Raises:
        DescriptionError: there is none, the signals do not fit into the message, or another one has its identifier.
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
    named = {
        entry: f"{entry} ({group.names[entry]})" if entry in group.names else entry
        for entry in (signal, *sent)
    }
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
            raise DescriptionError(
                f"{known.source} gives its identifier {message.frame_id:#x} to {other.name}, too"
            )
    return message


def find_counter(known: MessageSet, message: str, signal: str) -> tuple[Message, Signal]:
    """A counter, after its message, by their names.

    Raises:
        DescriptionError: there is none, or it is no whole number that goes up by one.
    """
    owner, counter = find_signal(known, message, signal)
    if counter.is_float or counter.scale != 1:
        found = "a float" if counter.is_float else f"an integer with factor {counter.scale:g}"
        text = f"a sample counter must be an integer with factor 1; in {known.source} {signal} is {found}"
        raise DescriptionError(text, signal=True)
    return owner, counter
