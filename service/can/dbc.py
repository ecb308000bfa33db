"""DBC files: which messages and signals a bus carries, and decoding of frames by them."""

from functools import lru_cache
from pathlib import Path
from typing import Literal, NamedTuple

import cantools.database
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error as CodingError

from monitor_core.wording import did_you_mean
from service.can.frames import Frame, FrameKey

__all__ = ["CodingError", "DbcError", "Decoder", "Message", "Signal"]

Undecoded = Literal["unwanted", "too_short", "undecodable"]


class DbcError(Exception):
    """A DBC file that cannot be used, or a name that it does not have, in words for the user."""


def read_dbc(path: Path) -> Database:
    """The database of a DBC file, cached until the file changes.

    Faults in unused messages are ignored; ``find_message`` checks the ones that are used.

    Raises:
        DbcError: the file cannot be read or is no DBC.
    """
    try:
        state = path.stat()
        return _read(path, state.st_mtime_ns, state.st_size)
    except OSError as error:
        raise DbcError(f"cannot read {path}: {error.strerror}") from None


def find_message(database: Database, name: str) -> Message:
    """The message of that name.

    Raises:
        DbcError: there is none, its signals do not fit into it, or another message has its identifier.
    """
    by_name = {message.name: message for message in database.messages}
    if name not in by_name:
        raise DbcError(f'no message "{name}" in the DBC: {did_you_mean(name, by_name)}')
    message = by_name[name]
    try:
        message.refresh(strict=True)
    except CodingError as error:
        raise DbcError(f"the DBC is wrong about this message: {error}") from None
    for other in database.messages:
        if other is not message and _identifier(other) == _identifier(message):
            raise DbcError(f"the DBC gives its identifier {message.frame_id:#x} to {other.name}, too")
    return message


def find_signal(message: Message, name: str) -> Signal:
    """The signal of that name in a message.

    Raises:
        DbcError: there is none.
    """
    by_name = {signal.name: signal for signal in message.signals}
    if name not in by_name:
        raise DbcError(f'no signal "{name}" in message {message.name}: {did_you_mean(name, by_name)}')
    return by_name[name]


def find_counter(message: Message, name: str) -> Signal:
    """The counter signal of this name.

    Raises:
        DbcError: there is none, or it is no whole number that goes up by one.
    """
    signal = find_signal(message, name)
    if signal.is_float or signal.scale != 1:
        found = "a float" if signal.is_float else f"an integer with factor {signal.scale:g}"
        raise DbcError(f"a sample counter must be an integer with factor 1; in the DBC {name} is {found}")
    return signal


@lru_cache(maxsize=16)
def _read(path: Path, _modified_ns: int, _size: int) -> Database:
    try:
        database = cantools.database.load_string(_text(path.read_bytes()), "dbc", strict=False)
    except CodingError as error:
        reason = str(error).removeprefix('DBC: "').removesuffix('"').replace(">>!<<", "<here>")
        raise DbcError(f"{path} is no valid DBC: {reason}") from None
    assert isinstance(database, Database)  # the other kind belongs to another file format
    return database


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:  # most tools write the Western code page
        return data.decode("cp1252", errors="replace")


def _identifier(message: Message) -> FrameKey:
    return FrameKey(message.frame_id, message.is_extended_frame)


# --- decoding -------------------------------------------------------------------------------------------


class _Wanted(NamedTuple):
    message: Message
    signals: tuple[str, ...]


class Decoder:
    """Decodes the wanted signals of a bus.

    Raises:
        DbcError: the DBC file cannot be read.
    """

    def __init__(self, dbc: Path) -> None:
        self._database = read_dbc(dbc)
        self._messages: dict[FrameKey, _Wanted] = {}

    def want(self, message: str, signal: str) -> FrameKey:
        """Decode that signal from now on; returns which frames carry it.

        Raises:
            DbcError: the DBC has no such message or signal.
        """
        found = find_message(self._database, message)
        find_signal(found, signal)
        key = _identifier(found)
        known = self._messages.get(key, _Wanted(found, ())).signals
        self._messages[key] = _Wanted(found, tuple(dict.fromkeys((*known, signal))))
        return key

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The frames with wanted signals: for the filters of the bus."""
        return tuple(self._messages)

    def message(self, key: FrameKey) -> Message:
        """The message that those frames carry."""
        return self._messages[key].message

    def wanted(self, key: FrameKey) -> tuple[str, ...]:
        """The names of the wanted signals of those frames."""
        return self._messages[key].signals

    def decode(self, frame: Frame) -> dict[str, float] | Undecoded:
        """The wanted signals in this frame (multiplexed ones may be absent), or the reason why there are none."""
        known = self._messages.get(frame.key)
        if known is None:
            return "unwanted"
        if len(frame.data) < known.message.length:
            return "too_short"
        try:
            values = known.message.decode_simple(frame.data, decode_choices=False)
        except CodingError:
            return "undecodable"
        return {name: float(values[name]) for name in known.signals if name in values}  # type: ignore[arg-type]
