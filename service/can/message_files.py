"""Reads files that describe the messages of a bus: DBC, KCD, SYM and ARXML."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import cantools.database
from cantools.database.can import Database

from monitor_core.wording import listed
from service.can.messages import (
    CodingError,
    DescriptionError,
    Message,
    MessageSet,
    key_of_message,
    read_unchanged,
    text_in,
)

KINDS: Mapping[str, str] = MappingProxyType({".dbc": "DBC", ".kcd": "KCD", ".sym": "SYM", ".arxml": "ARXML"})
"""Formats by file suffix"""
_GROUP, _SOURCE, _ANY_SOURCE = 0x3FFFF00, 0xFF, 0xFE
"""Bits of a J1939 identifier: parameter group with destination, source address; and the address for any source"""


def read_messages(path: Path) -> MessageSet:
    """The messages that a file describes; cached until the file changes.  The suffix determines the format.

    Raises:
        DescriptionError: the file cannot be read, or is not of that format.
    """
    kind = KINDS.get(path.suffix.lower())
    if kind is None:
        raise DescriptionError(f"{path} describes no messages: its name must end with {listed(tuple(KINDS), 'or')}")
    return read_unchanged(_read, path, kind)


@lru_cache(maxsize=16)
def _read(path: Path, kind: str, _modified_ns: int, _size: int) -> MessageSet:
    text = text_in(path.read_bytes())
    try:
        database = cantools.database.load_string(text, kind.lower(), strict=False)
    except CodingError as error:
        raise DescriptionError(f"{path} is no valid {kind}: {_reason(error, kind)}") from None
    assert isinstance(database, Database)  # the other class belongs to another file format
    masks = {key_of_message(m): _group_mask(m) for m in database.messages if m.protocol == "j1939"}
    return MessageSet(tuple(database.messages), path.name, masks=masks)


def _group_mask(message: Message) -> int:
    """The bits of a J1939 identifier that identify the message: not the priority, and not a source that means "any"."""
    return _GROUP | (0 if message.frame_id & _SOURCE == _ANY_SOURCE else _SOURCE)


def _reason(error: CodingError, kind: str) -> str:
    """The reason given by cantools, or its internal error if the file has made it fail."""
    original = getattr(error, f"e_{kind.lower()}", None)
    if isinstance(original, TypeError | AttributeError | LookupError):
        return f"an entry is missing or wrong ({original})"
    return str(error).removeprefix(f'{kind}: "').removesuffix('"').replace(">>!<<", "<here>")
