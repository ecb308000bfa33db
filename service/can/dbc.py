"""DBC files: which messages and signals a bus carries, and decoding of frames by them."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cantools.database
import numpy as np
from cantools.database.can import Database, Message, Signal
from cantools.database.errors import Error as CodingError

from monitor_core.arrays import Ints
from monitor_core.wording import did_you_mean
from service.can.decode_plan import Column, MessagePlan
from service.can.frames import FrameBlock, FrameKey

__all__ = ["CodingError", "Column", "DbcError", "Decoded", "Decoder", "Message", "Signal"]

FRAME_REASONS = ("unwanted", "too_short", "undecodable", "signal_absent")
"""Why a frame gave nothing (or, signal_absent, not all that was wanted): ``Decoder.dropped``."""


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


# --- decoding --------------------------------------------------------------------------------------------


class Decoded(NamedTuple):
    """The wanted signals of the frames of one message in a block; each frame has at least one of them."""

    places: Ints
    """Of the frames in the block (N,)"""
    t_us: Ints
    """Times of receipt (N,)"""
    signals: Mapping[str, Column]
    """By name, each (N,)"""


class Decoder:
    """Decodes the wanted signals of a bus.

    Raises:
        DbcError: the DBC file cannot be read.
    """

    def __init__(self, dbc: Path) -> None:
        self._database = read_dbc(dbc)
        self._messages: dict[FrameKey, Message] = {}
        self._wanted: dict[FrameKey, tuple[str, ...]] = {}
        self._plans: dict[FrameKey, MessagePlan] = {}
        self.dropped = dict.fromkeys(FRAME_REASONS, 0)
        """Frames by reason"""

    def want(self, message: str, signal: str) -> FrameKey:
        """Decode that signal from now on; returns which frames carry it.

        Raises:
            DbcError: the DBC has no such message or signal.
        """
        found = find_message(self._database, message)
        find_signal(found, signal)
        key = _identifier(found)
        self._messages[key] = found
        self._wanted[key] = tuple(dict.fromkeys((*self._wanted.get(key, ()), signal)))
        self._plans.pop(key, None)
        return key

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The frames with wanted signals: for the filters of the bus."""
        return tuple(self._messages)

    def message(self, key: FrameKey) -> Message:
        """The message that those frames carry."""
        return self._messages[key]

    def decode(self, frames: FrameBlock) -> dict[FrameKey, Decoded]:
        """The wanted signals in these frames, by message; counts the frames where some or all are missing."""
        found: dict[FrameKey, Decoded] = {}
        left, ids = frames.size, frames.ids
        for key in self._messages:
            places = np.flatnonzero(ids == key.record_id)
            if places.size:
                left -= places.size
                decoded = self._decoded(key, frames, places)
                if decoded.places.size:
                    found[key] = decoded
        self.dropped["unwanted"] += left
        return found

    def _decoded(self, key: FrameKey, frames: FrameBlock, places: Ints) -> Decoded:
        if key not in self._plans:
            self._plans[key] = MessagePlan(self._messages[key], self._wanted[key])
        plan = self._plans[key]
        long = frames.lengths[places] >= plan.length
        if not long.all():
            self.dropped["too_short"] += int(np.count_nonzero(~long))
            places = places[long]
        if not places.size:
            return Decoded(places, np.zeros(0, np.int64), {})
        signals, known = plan.decode(frames.data[places])
        if not plan.multiplexed:
            return Decoded(places, frames.t_us[places], signals)
        present = np.array([column.present for column in signals.values()]) & known
        self.dropped["undecodable"] += int(np.count_nonzero(~known))
        self.dropped["signal_absent"] += int(np.count_nonzero(known & ~present.all(axis=0)))
        some = present.any(axis=0)
        if not some.all():
            places = places[some]
            signals = {name: Column(c.values[some], c.present[some]) for name, c in signals.items()}
        return Decoded(places, frames.t_us[places], signals)
