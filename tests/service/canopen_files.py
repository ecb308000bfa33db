"""The EDS of a small CANopen drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

INT8, INT16, INT32, UINT8, UINT16, UINT32, REAL32 = 2, 3, 4, 5, 6, 7, 8


class Pdo(NamedTuple):
    """A transmit PDO: the objects in it, as "60770010", and what 0x1800 and on say of it."""

    objects: Sequence[str]
    cob_id: str
    transmission: int = 1


OBJECTS: Mapping[str, tuple[str, int]] = {
    "6041": ("statusword", UINT16),
    "6064": ("position_actual_value", INT32),
    "606C": ("velocity_actual_value", INT32),
    "6077": ("torque_actual_value", INT16),
    "6078": ("current_actual_value", INT16),
    "2031": ("motor_voltage", REAL32),
}
TWO_PDOS = (
    Pdo(("60410010", "60770010", "60780010"), "$NODEID+0x180"),
    Pdo(("60640020", "606C0020"), "$NODEID+0x280"),
    Pdo(("20300108", "00050008", "20310020"), "$NODEID+0x380", 255),
)
"""Torque and motion in two PDOs, both after a SYNC; temperature and voltage by events, with a gap between them"""


def eds(pdos: Sequence[Pdo] = TWO_PDOS) -> str:
    """The file."""
    text = "[FileInfo]\nFileName=drive.eds\n\n[DeviceInfo]\nVendorName=Example\n"
    text += "\n[DummyUsage]\n" + "".join(f"Dummy000{n}=1\n" for n in range(1, 8))
    text += _entry("1005", "COB-ID SYNC", UINT32, "0x80")
    for number, pdo in enumerate(pdos):
        text += _record(f"18{number:02X}", [("5", UINT8), (pdo.cob_id, UINT32), (str(pdo.transmission), UINT8)])
        mapped = [(f"0x{entry}", UINT32) for entry in pdo.objects]
        text += _record(f"1A{number:02X}", [(str(len(mapped)), UINT8), *mapped])
    text += _record("2030", [("1", UINT8), ("0", INT8)])
    return text + "".join(_entry(index, name, kind, "0") for index, (name, kind) in OBJECTS.items())


def settings(node: int, rated: Mapping[str, int], encoder: tuple[int, int]) -> str:
    """What a DCF has beyond the EDS: its node, rated torque or current by object, increments in so many turns."""
    text = f"\n[DeviceComissioning]\nNodeID=0x{node:02X}\nBaudrate=500\n"
    text += "".join(_entry(index, "rated", UINT32, str(value)) for index, value in rated.items())
    return text + _record("608F", [("2", UINT8), *((str(number), UINT32) for number in encoder)])


def _record(index: str, members: Sequence[tuple[str, int]]) -> str:
    text = f"\n[{index}]\nParameterName=record {index}\nObjectType=0x9\nSubNumber={len(members)}\n"
    return text + "".join(
        _entry(f"{index}sub{n:X}", f"entry {n}", kind, value) for n, (value, kind) in enumerate(members)
    )


def _entry(section: str, name: str, kind: int, value: str) -> str:
    return (
        f"\n[{section}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\n"
        f"DefaultValue={value}\nPDOMapping=1\n"
    )
