"""Reads frames from a logger's measurement file (.mf4, ASAM MDF 4 with bus logging) with asammdf, which is optional."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from can.util import dlc2len
from numpy.typing import NDArray

from monitor_core.arrays import Ints
from service.can.frames import EXTENDED, FD_BYTES, ID_BITS, FrameBlock, concatenate_frames
from service.can.user_errors import RecordError

_ROWS = 8192
_HEAD = 68
"""Bytes of the identification block and the name of the next block"""
_LATEST_S = 2**42
_DATA, _REJECTED = "CAN_DataFrame", {"CAN_ErrorFrame": "error_frame", "CAN_RemoteFrame": "remote_frame"}
_LENGTHS = np.array([dlc2len(dlc) for dlc in range(16)])


class Mf4Frames:
    """The frames in a file of a logger; ``path``: for error messages only.

    Raises:
        RecordError: asammdf is not installed.
        Exception: whatever asammdf raises for a damaged file.
    """

    def __init__(self, path: Path, file: BinaryIO) -> None:
        try:
            from asammdf import MDF
        except ImportError:
            raise RecordError(f"{path}: to read .mf4 install asammdf: pip install 'axiswatch[mf4]'") from None
        head = file.read(_HEAD)
        if not (head.startswith((b"MDF     4", b"UnFinMF 4")) and head[64:] == b"##HD"):
            raise ValueError("it does not begin as one of version 4")
        file.seek(0)
        self._mdf: Any = MDF(file)
        self.rejected = dict.fromkeys(_REJECTED.values(), 0)
        """Number of entries that are no data frames, by reason"""
        self._groups = list[int]()
        for number, group in enumerate(self._mdf.groups):
            names, count = {channel.name for channel in group.channels}, int(group.channel_group.cycles_nr)
            if _DATA in names and count:
                self._groups.append(number)
            for name in names & _REJECTED.keys():
                self.rejected[_REJECTED[name]] += count
        self._start_us = round(self._mdf.header.start_time.timestamp() * 1e6)

    def parts(self) -> Iterator[tuple[FrameBlock, Ints, float]]:
        """All frames in the order of time, their channel numbers (N,), and the part that has been read, 0 to 1.

        Several groups are merged.

        Raises:
            Exception: whatever asammdf raises of a damaged file.
        """
        sizes = [int(self._mdf.groups[number].channel_group.cycles_nr) for number in self._groups]
        groups = [self._group(number, size) for number, size in zip(self._groups, sizes, strict=True)]
        read = 0
        for frames, channels in merged(groups):
            read += frames.size
            yield frames, channels, min(1.0, read / sum(sizes))

    def close(self) -> None:
        """Close the file."""
        self._mdf.close()

    def _group(self, number: int, size: int) -> Iterator[_Rows]:
        for first in range(0, size, _ROWS):
            signal = self._mdf.get(_DATA, number, record_offset=first, record_count=_ROWS)
            yield self._rows(signal.samples, np.asarray(signal.timestamps, np.float64))

    def _rows(self, samples: NDArray[np.void], t_s: NDArray[np.float64]) -> _Rows:
        if not (np.isfinite(t_s) & (abs(t_s) < _LATEST_S)).all():
            raise ValueError("no frame has such a time")
        names = {str(name).removeprefix(f"{_DATA}."): str(name) for name in samples.dtype.names or ()}
        data = np.asarray(samples[names["DataBytes"]], np.uint8).reshape(len(samples), -1)[:, :FD_BYTES]
        if "DataLength" in names:
            length = samples[names["DataLength"]].astype(np.int64)
        else:
            length = _LENGTHS[samples[names["DLC"]].astype(np.int64) & 15]
        if (length > data.shape[1]).any():
            raise ValueError("a frame is longer than its bytes")
        frame_id = samples[names["ID"]].astype(np.int64)
        extended = frame_id & EXTENDED != 0
        if "IDE" in names:
            extended = samples[names["IDE"]] != 0
        t_us = self._start_us + np.rint(t_s * 1e6).astype(np.int64)
        ids = np.where(extended, frame_id & ID_BITS | EXTENDED, frame_id & ID_BITS)
        channels = np.zeros(len(samples), np.int64)
        if "BusChannel" in names:
            channels = samples[names["BusChannel"]].astype(np.int64)
        return FrameBlock.from_columns(t_us, ids, length, data), channels


_Rows = tuple[FrameBlock, Ints]
"""Frames and their channel numbers"""


def merged(groups: Sequence[Iterator[_Rows]]) -> Iterator[_Rows]:
    """Merge groups that are each in the order of time."""
    waiting = {k: part for k, group in enumerate(groups) if (part := next(group, None)) is not None}
    while waiting:
        limit = min(int(frames.t_us.max()) for frames, _ in waiting.values())
        ready = list[_Rows]()
        for k, (frames, channels) in list(waiting.items()):
            now = frames.t_us <= limit
            ready.append((frames.select(now), channels[now]))
            waiting[k] = frames.select(~now), channels[~now]
            if now.all():
                del waiting[k]
                if (part := next(groups[k], None)) is not None:
                    waiting[k] = part
        block = concatenate_frames([frames for frames, _ in ready])
        order = np.argsort(block.t_us, kind="stable")
        yield block.select(order), np.concatenate([channels for _, channels in ready])[order]
