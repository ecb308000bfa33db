"""Decodes frames to physical values by the DBC."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple

from cantools.database.can import Message
from cantools.database.errors import Error

from service.can.dbc import find_message, find_signal, read_dbc
from service.can.frames import Frame

Undecoded = Literal["unwanted", "too_short", "undecodable"]


class FrameKey(NamedTuple):
    """Identifies the messages of a bus."""

    can_id: int
    extended: bool


class _Wanted(NamedTuple):
    message: Message
    signals: tuple[str, ...]


class Decoder:
    """Decodes the wanted signals of a bus.

    Args:
        dbc: the DBC file.
        wanted: (message, signal) by their names in the DBC.

    Raises:
        DbcError: the file cannot be read, or has no such message or signal.
    """

    def __init__(self, dbc: Path, wanted: Iterable[tuple[str, str]]) -> None:
        database = read_dbc(dbc)
        self._messages: dict[FrameKey, _Wanted] = {}
        self._by_name: dict[str, FrameKey] = {}
        for name, signal in wanted:
            message = find_message(database, name)
            find_signal(message, signal)
            key = FrameKey(message.frame_id, message.is_extended_frame)
            known = self._messages.get(key, _Wanted(message, ())).signals
            self._messages[key] = _Wanted(message, tuple(dict.fromkeys((*known, signal))))
            self._by_name[name] = key

    @property
    def keys(self) -> tuple[FrameKey, ...]:
        """The frames with wanted signals: for the filters of the bus."""
        return tuple(self._messages)

    def key(self, message: str) -> FrameKey:
        """The frames of a wanted message."""
        return self._by_name[message]

    def message(self, key: FrameKey) -> Message:
        """The message that those frames carry."""
        return self._messages[key].message

    def wanted(self, key: FrameKey) -> tuple[str, ...]:
        """The names of the wanted signals of those frames."""
        return self._messages[key].signals

    def decode(self, frame: Frame) -> dict[str, float] | Undecoded:
        """The wanted signals in this frame (multiplexed ones may be absent), or the reason why there are none."""
        known = self._messages.get(FrameKey(frame.can_id, frame.extended))
        if known is None:
            return "unwanted"
        if len(frame.data) < known.message.length:
            return "too_short"
        try:
            values = known.message.decode_simple(frame.data, decode_choices=False)
        except Error:
            return "undecodable"
        return {name: float(values[name]) for name in known.signals if name in values}  # type: ignore[arg-type]
