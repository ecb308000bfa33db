"""Schema of the buses and of the messages on them; see configuration.py."""

from typing import Annotated, Any, Literal

from pydantic import Field

from service.config.schema.base_table import FilePath, NonEmptyText, NonZero, PlainName, Real, TomlTable

MAX_BYTES = 64
"""Data bytes of the longest frame"""
LAST_STANDARD_ID, _LAST_ID = 0x7FF, 0x1FFFFFFF
_LAST_PGN = 0x3FFFF
FLOAT_BITS = (16, 32, 64)


class BitsConfig(TomlTable):
    """[[bus.message.signal]]: a signal by its bits."""

    name: NonEmptyText
    """name of the signal"""
    start_bit: Annotated[int, Field(strict=True)] = Field(ge=0, lt=8 * MAX_BYTES)
    """lowest bit, or highest bit in big endian: 8 * byte + bit, both from 0; bit 0 is the lowest of a byte"""
    length: Annotated[int, Field(strict=True)] = Field(ge=1, le=64)
    """number of bits"""
    kind: Literal["unsigned", "signed", "float"] = "unsigned"
    """kind of number: "unsigned", "signed" or "float" (16, 32 or 64 bits)"""
    byte_order: Literal["little", "big"] = "little"
    """"little": lowest byte first (Intel); "big": highest byte first (Motorola)"""
    factor: NonZero = 1.0
    """value = factor * number + offset"""
    offset: Real = 0.0
    """value = factor * number + offset"""


class MessageConfig(TomlTable):
    """[[bus.message]]: a message by its identifier."""

    name: NonEmptyText
    """name by which axes refer to the message"""
    id: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=_LAST_ID)
    """identifier, such as 0x181; or pgn"""
    pgn: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=_LAST_PGN)
    """parameter group number of J1939, such as 0xFF31: any priority, and any source address unless it is given"""
    source_address: Annotated[int, Field(strict=True)] | None = Field(None, ge=0, le=0xFF)
    """with pgn: source address of the drive"""
    extended: Annotated[bool, Field(strict=True)] | None = None
    """whether the identifier has 29 bits; default: if it is above 0x7FF"""
    signal: tuple[BitsConfig, ...] = Field(min_length=1)
    """its signals, [[bus.message.signal]]"""

    @property
    def is_extended(self) -> bool:
        """Whether its identifier has 29 bits."""
        if self.extended is None:
            return self.id is None or self.id > LAST_STANDARD_ID
        return self.extended


class BusConfig(TomlTable):
    """[[bus]]: one CAN bus."""

    name: PlainName
    """name by which axes refer to the bus: letters, digits, - and _"""
    interface: NonEmptyText = "socketcan"
    """python-can interface: socketcan, virtual, pcan, ..."""
    channel: NonEmptyText
    """channel of that interface, e.g. can0"""
    messages: FilePath | None = None
    """file that describes the messages on the bus: .dbc, .kcd, .sym or .arxml, relative to this file"""
    message: tuple[MessageConfig, ...] = ()
    """messages that no file describes, [[bus.message]]"""
    queue_frames: Annotated[int, Field(strict=True)] = Field(100_000, ge=100, le=10_000_000)
    """most frames that wait for the worker; further ones are dropped"""
    options: dict[str, Any] = Field(default_factory=dict)
    """passed to python-can as they are: bitrate, fd, ..."""
