"""The messages that CANopen drives (CiA 402) send, from their EDS or DCF, with the objects as signals.

The object dictionary has the enabled transmit PDOs with their identifiers (0x1800 and following) and the objects in
them (0x1A00 and following).  A value that a tool has set (ParameterValue, in a DCF) takes precedence over the default.
"""

from __future__ import annotations

import configparser
import io
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from service.can.frames import FrameKey
from service.can.messages import (
    Bits,
    DescriptionError,
    MessageGroup,
    MessageSet,
    NumberKind,
    message_of,
    read_unchanged,
    text_in,
)

if TYPE_CHECKING:
    from canopen import ObjectDictionary
    from canopen.objectdictionary import ODVariable

LAST_NODE = 127
SUFFIXES: Final = (".eds", ".dcf")
_NAMES: Final[dict[str, str]] = {
    "0x6064": "position actual value",
    "0x606C": "velocity actual value",
    "0x6077": "torque actual value",
    "0x6078": "current actual value",
}
_SIGNED: Final = {f"0x{int(name, 16) + 0x800 * n:04X}" for name in _NAMES for n in range(8)}
"""Objects that are signed by CiA 402, for up to eight axes of a drive; some files have no or wrong types for them."""
_PDO, _MAPPING, _SYNC, _PERIOD = 0x1800, 0x1A00, 0x1005, 0x1006
_MOST_PDOS, _BITS = 512, 64
_DISABLED, _EXTENDED, _ID = 1 << 31, 1 << 29, (1 << 29) - 1
_SYNCHRONOUS, _ON_REQUEST, _EVENT = range(241), (252, 253), 255
"""Transmission types"""
_LAST_OF_COMMUNICATION = 0x1FFF
_FIRST_OBJECT = 0x1000
"""Indices below are data types: they are fill bytes in a PDO."""
_TOOL = "with the tool of the drive, and save the file again"


def node_name(node_id: int) -> str:
    """Name of the message group of a node."""
    return f"node{node_id}"


def node_of(name: str) -> int | None:
    """The node id in the name of a message group; None: the name has another form."""
    found = re.fullmatch(r"node(\d{1,3})", name)
    return int(found[1]) if found and 1 <= int(found[1]) <= LAST_NODE else None


def object_name(index: int, subindex: int = 0) -> str:
    """Name of the signal of an object: 0x6077, or 0x2030.1 with a subindex."""
    return f"0x{index:04X}" + (f".{subindex}" if subindex else "")


def read_drive(path: Path, node_id: int) -> MessageSet:
    """The messages that a drive sends, from its EDS or DCF; cached until the file changes.

    Raises:
        DescriptionError: the file cannot be read, or is no EDS or DCF.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise DescriptionError(f"{path} describes no CANopen drive: its name must end with .eds or .dcf")
    return read_unchanged(_read, path, node_id)


def commissioned_node(path: Path) -> int | None:
    """The node id for which the settings in a DCF were saved; None: not given, as in every EDS.

    Raises:
        DescriptionError: as of ``read_drive``.
    """
    node_id = _known(path, None).node_id
    return node_id if node_id is not None and 1 <= node_id <= LAST_NODE else None


def value_in(path: Path, node_id: int, index: int, subindex: int = 0) -> int | None:
    """The integer value of an object in an EDS or DCF; None: not given.

    Raises:
        DescriptionError: as of ``read_drive``.
    """
    return _number(_known(path, node_id), index, subindex)


def _known(path: Path, node_id: int | None) -> ObjectDictionary:
    try:
        return _dictionary(path, node_id)
    except OSError as error:
        raise DescriptionError(f"cannot read {path}: {error.strerror}") from None


@lru_cache(maxsize=64)
def _read(path: Path, node_id: int, _modified_ns: int, _size: int) -> MessageSet:
    known = _dictionary(path, node_id)
    name, faults, sync = node_name(node_id), dict[str, str](), dict[FrameKey, FrameKey]()
    messages = []
    for pdo in _pdos(known, node_id):
        if pdo.fault:
            faults |= {bits.name: f"{pdo.name} holds it, but {pdo.fault}" for bits in pdo.signals}
        elif pdo.signals:
            message = message_of(f"{name}.{pdo.name}", pdo.key, pdo.signals)
            if pdo.transmission in _SYNCHRONOUS:
                sync[pdo.key] = FrameKey((_number(known, _SYNC) or 0x80) & 0x7FF, False)
                period_us = _number(known, _PERIOD) or 0
                message.cycle_time = round(max(1, pdo.transmission) * period_us / 1000) or None
            messages.append(message)
    for pdo in _pdos(known, node_id, as_delivered=True):
        for bits in pdo.signals:
            words = f"{pdo.name} holds it as delivered, but not as configured here (ParameterValue): map it, {_TOOL}"
            faults.setdefault(bits.name, words)
    group = MessageGroup(
        tuple(messages), faults, f"no transmit PDO holds it in {path.name}: map it, {_TOOL}", _names(known)
    )
    return MessageSet(tuple(messages), path.name, {name: group}, sync)


def _names(known: ObjectDictionary) -> dict[str, str]:
    """Names of the objects that PDOs may contain, from the file."""
    from canopen.objectdictionary import ODVariable

    found = dict[str, str]()
    for entry in known.values():
        for variable in [entry] if isinstance(entry, ODVariable) else entry.values():
            if variable.index > _LAST_OF_COMMUNICATION and variable.name:
                found[object_name(variable.index, variable.subindex)] = " ".join(variable.name.split())
    return found | _NAMES


# --- The transmit PDOs of an object dictionary ------------------------------------------------------------------------


class _Pdo(NamedTuple):
    name: str
    key: FrameKey
    transmission: int
    signals: tuple[Bits, ...]
    fault: str = ""
    """Why the PDO is not sent, and how to correct that; empty: it is sent"""


def _pdos(known: ObjectDictionary, node_id: int, as_delivered: bool = False) -> Iterator[_Pdo]:
    """The transmit PDOs; ``as_delivered``: use the default values."""
    for number in range(_MOST_PDOS):
        if _PDO + number not in known or _MAPPING + number not in known:
            continue
        cob_id = _number(known, _PDO + number, 1, as_delivered)
        if cob_id is None:
            cob_id = 0x180 + 0x100 * number + node_id if number < 4 else _DISABLED  # the predefined ones
        transmission = _number(known, _PDO + number, 2, as_delivered)
        transmission = _EVENT if transmission is None else transmission
        signals, fault = _mapped(known, number, as_delivered)
        where = object_name(_PDO + number, 1)
        if cob_id & _DISABLED:
            fault = f"is disabled (bit 31 of its COB-ID, object {where}): enable it, {_TOOL}"
        elif transmission in _ON_REQUEST:
            where = object_name(_PDO + number, 2)
            fault = f"is sent on request only (transmission type {transmission}, object {where}): set type 1, {_TOOL}"
        key = FrameKey(cob_id & (_ID if cob_id & _EXTENDED else 0x7FF), bool(cob_id & _EXTENDED))
        yield _Pdo(f"TPDO{number + 1}", key, transmission, tuple(signals), fault)


def _mapped(known: ObjectDictionary, number: int, as_delivered: bool) -> tuple[list[Bits], str]:
    """The objects in a PDO, and its fault in words; empty: none."""
    found, at = list[Bits](), 0
    for place in range(1, (_number(known, _MAPPING + number, 0, as_delivered) or 0) + 1):
        entry = _number(known, _MAPPING + number, place, as_delivered)
        if entry is None:
            return (
                found,
                f"its entry {object_name(_MAPPING + number, place)} is not given: map an object, {_TOOL}",
            )
        index, subindex, length = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
        name = object_name(index, subindex)
        if index >= _FIRST_OBJECT and 0 < length <= _BITS and all(bits.name != name for bits in found):
            kind = _kind(_variable(known, index, subindex), length)
            found.append(Bits(name, at, length, "signed" if name in _SIGNED and kind == "unsigned" else kind))
        at += length
    if at > _BITS:
        return found, f"its objects have {at} bits, and a frame has {_BITS}: map fewer, {_TOOL}"
    return found, ""


def _kind(variable: ODVariable | None, length: int) -> NumberKind:
    from canopen.objectdictionary import datatypes

    if variable is not None and variable.data_type in datatypes.SIGNED_TYPES:
        return "signed"
    real = {32: datatypes.REAL32, 64: datatypes.REAL64}.get(length)
    return "float" if variable is not None and real is not None and variable.data_type == real else "unsigned"


def _variable(known: ObjectDictionary, index: int, subindex: int = 0) -> ODVariable | None:
    from canopen.objectdictionary import ODVariable

    found = known.get(index)
    if found is None or isinstance(found, ODVariable):
        return found
    try:
        member = found[subindex]
    except KeyError:
        return None
    return member if isinstance(member, ODVariable) else None


def _number(known: ObjectDictionary, index: int, subindex: int = 0, as_delivered: bool = False) -> int | None:
    """The value of an object; None: not given."""
    variable = _variable(known, index, subindex)
    if variable is None:
        return None
    value = variable.default if variable.value is None or as_delivered else variable.value
    return value if isinstance(value, int) else None


# --- The file ---------------------------------------------------------------------------------------------------------


class _Text(io.StringIO):
    """A text with a file name, as the canopen reader looks at the suffix."""

    name = "drive.eds"


def _dictionary(path: Path, node_id: int | None) -> ObjectDictionary:
    from canopen import ObjectDictionaryError, import_od

    text = text_in(path.read_bytes())
    try:
        if "[deviceinfo]" not in text.lower():
            raise ValueError("there is no section [DeviceInfo]")
        return import_od(_Text(text), node_id)
    except (configparser.NoOptionError, configparser.NoSectionError) as error:
        line = next((n for n, row in enumerate(text.splitlines(), 1) if row.strip() == f"[{error.section}]"), 0)
        reason = f"line {line}: {error.message}" if line else error.message
    except configparser.Error as error:
        reason = error.message.replace("'drive.eds'", path.name)
    except KeyError as error:
        reason = f"a section of the object is missing: {error}"
    except (ValueError, TypeError, ObjectDictionaryError) as error:
        reason = str(error)
    raise DescriptionError(f"{path} is no valid EDS or DCF: {' '.join(reason.split())}")
