"""CAN frames: blocks of records for processing, single frames for writing and tests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Ints

EXTENDED = 0x80000000
"""Flag of an extended identifier in the id of a record, as in SocketCAN."""

CLASSIC_BYTES, FD_BYTES = 8, 64


def _record(data_bytes: int) -> np.dtype[np.void]:
    """Type of a record: time [us since 1970], id with flag, length, flags of CAN FD, data padded with zeros."""
    fields = [("t_us", "<i8"), ("id", "<u4"), ("length", "u1"), ("flags", "u1"), ("_", "u1", (2,))]
    return np.dtype([*fields, ("data", "u1", (data_bytes,))])


CLASSIC_RECORD, FD_RECORD = _record(CLASSIC_BYTES), _record(FD_BYTES)


ID_BITS, STANDARD_BITS = 0x1FFFFFFF, 0x7FF
"""Bits of an id without the flag, and of a standard one"""


class FrameKey(NamedTuple):
    """Identifies a message of a bus."""

    can_id: int
    extended: bool

    @property
    def record_id(self) -> int:
        """The id as in a record, with the flag."""
        return self.can_id | EXTENDED if self.extended else self.can_id


class FrameFilter(NamedTuple):
    """Filter of a bus: lets frames through whose identifier equals that of the key in the bits of the mask."""

    key: FrameKey
    mask: int = ID_BITS
    """Bits of the identifier that are compared"""


def key_of(record_id: int) -> FrameKey:
    """The key of frames with this id in their records."""
    return FrameKey(record_id & ~EXTENDED, record_id >= EXTENDED)


class Frame(NamedTuple):
    """A received CAN frame, with its time in whole microseconds since 1970."""

    t_us: int
    can_id: int
    extended: bool
    data: bytes

    @property
    def key(self) -> FrameKey:
        """The key of its message."""
        return FrameKey(self.can_id, self.extended)


_SET_BACK_US = 500_000
"""Frames of a log may be out of order by less than this; a larger step means that the clock was set back."""


class FrameBlock:
    """Frames in order of receipt, as an array of records (N,).

    The type of the records is CLASSIC_RECORD, or FD_RECORD if a frame may be longer than 8 bytes.
    """

    __slots__ = ("records",)

    def __init__(self, records: NDArray[np.void]) -> None:
        self.records = records

    @classmethod
    def from_frames(cls, frames: Sequence[Frame]) -> FrameBlock:
        """The block of these frames."""
        lengths = np.array([len(frame.data) for frame in frames], np.int64)
        width = int(lengths.max(initial=0))
        data = b"".join([frame.data.ljust(width, b"\0") for frame in frames])
        t_us = np.array([frame.t_us for frame in frames], np.int64)
        ids = [frame.can_id | EXTENDED if frame.extended else frame.can_id for frame in frames]
        columns = np.frombuffer(data, np.uint8).reshape(len(frames), width)
        return cls.from_columns(t_us, np.array(ids, np.int64), lengths, columns)

    @classmethod
    def from_columns(
        cls, t_us: Ints, ids: Ints, lengths: Ints, data: NDArray[np.uint8], flags: Ints | int = 0
    ) -> FrameBlock:
        """The block of frames with these times, ids with flag, lengths (N,) and data (N, W).

        Data beyond the length is ignored; ``flags``: CAN FD flags (N,).
        """
        width = FD_BYTES if lengths.max(initial=0) > CLASSIC_BYTES else CLASSIC_BYTES
        records = np.zeros(len(lengths), FD_RECORD if width > CLASSIC_BYTES else CLASSIC_RECORD)
        records["t_us"], records["id"], records["length"], records["flags"] = t_us, ids, lengths, flags
        data = data[:, :width]
        inside = np.arange(data.shape[1]) < lengths[:, np.newaxis]
        records["data"][:, : data.shape[1]] = np.where(inside, data, 0)
        return cls(records)

    @property
    def t_us(self) -> Ints:
        """Times of receipt (N,), us."""
        return self.records["t_us"]

    @property
    def ids(self) -> NDArray[np.uint32]:
        """Ids (N,), with the flag EXTENDED."""
        return self.records["id"]

    @property
    def lengths(self) -> NDArray[np.uint8]:
        """Number of data bytes (N,)."""
        return self.records["length"]

    @property
    def data(self) -> NDArray[np.uint8]:
        """Data (N, 8 or 64), zero beyond the length."""
        return self.records["data"]

    @property
    def size(self) -> int:
        """Number of frames N."""
        return len(self.records)

    def __bool__(self) -> bool:
        """Whether there are frames."""
        return self.size > 0

    def select(self, frames: slice | Ints | Bools) -> FrameBlock:
        """The block with only these frames: a slice, indices or a mask (N,)."""
        return FrameBlock(self.records[frames])

    def in_order(self) -> FrameBlock:
        """The block in the order of time, with the steps of a clock that was set back removed."""
        back_us = np.maximum(-np.diff(self.t_us, prepend=self.t_us[:1]), 0)
        if not back_us.any():
            return self
        records = self.records.copy()
        records["t_us"] += np.cumsum(np.where(back_us > _SET_BACK_US, back_us, 0))
        return FrameBlock(records[np.argsort(records["t_us"], kind="stable")])

    def counts(self) -> dict[FrameKey, int]:
        """Number of frames of each key."""
        ids, counts = np.unique(self.ids, return_counts=True)
        return dict(zip(map(key_of, ids.tolist()), counts.tolist(), strict=True))

    def frames(self) -> Iterator[Frame]:
        """The frames as single objects."""
        columns: Any = (self.t_us.tolist(), self.ids.tolist(), self.lengths.tolist(), self.data)
        for t_us, record_id, length, data in zip(*columns, strict=True):
            yield Frame(t_us, *key_of(record_id), data[:length].tobytes())


NO_FRAMES = FrameBlock(np.zeros(0, CLASSIC_RECORD))


def concatenate_frames(blocks: Sequence[FrameBlock]) -> FrameBlock:
    """Join blocks, in their order."""
    if len(blocks) < 2:
        return blocks[0] if blocks else NO_FRAMES
    records = [block.records for block in blocks]
    if len({array.dtype for array in records}) > 1:
        records = [_widened(array) for array in records]
    return FrameBlock(np.concatenate(records))


def _widened(records: NDArray[np.void]) -> NDArray[np.void]:
    if records.dtype == FD_RECORD:
        return records
    wide = np.zeros(len(records), FD_RECORD)
    for name in ("t_us", "id", "length", "flags"):
        wide[name] = records[name]
    wide["data"][:, :CLASSIC_BYTES] = records["data"]
    return wide
