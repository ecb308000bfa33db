"""Records frames to a candump log or a .blf file."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import can

from service.can.frames import CLASSIC_BYTES, EXTENDED, Frame, FrameBlock
from service.can.user_errors import RecordError


class FrameRecorder:
    """Writes a candump log (.log), which keeps all of a frame: time to the microsecond, name of the bus, CAN FD.

    The other formats of python-can lose some of this and are refused: .asc rounds the start time to milliseconds, .trc
    has no CAN FD, .blf has no names of buses and is written to the disk in steps of 128 KiB (see ``write_blf``).

    Raises:
        RecordError: the suffix is not .log, or the file exists or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix.lower() != ".log":
            raise RecordError(f"{path}: frames are recorded as .log, which keeps them exactly; name it so")
        try:
            self._file = path.open("x", encoding="utf-8", newline="\n")
        except FileExistsError:
            raise RecordError(f"{path} exists already: choose another name, or remove it") from None
        except OSError as error:
            raise RecordError(f"cannot write {path}: {error.strerror}") from None
        self.path = path

    def write(self, bus: str, frames: FrameBlock) -> None:
        """Write frames of a bus; when this returns, they are in the file.

        Raises:
            RecordError: the file cannot be written.
        """
        try:
            self._file.writelines(_log_lines(bus, frames))
            self._file.flush()
        except OSError as error:
            raise self._error(error) from None

    def close(self) -> None:
        """Close the file; a second time does nothing.

        Raises:
            RecordError: the last frames cannot be written; the file is closed all the same.
        """
        try:
            self._file.close()
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: OSError) -> RecordError:
        return RecordError(f"cannot write {self.path}: {error.strerror}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _1: type[BaseException] | None, _2: object, _3: TracebackType | None) -> None:
        self.close()


def _log_lines(bus: str, frames: FrameBlock) -> Iterator[str]:
    """Lines of a candump log."""
    bus = f"can{bus}" if bus.isdigit() else bus  # readers would take a mere number for a channel number
    records, digits = frames.records, frames.data.tobytes().hex().upper()
    columns = (records[name].tolist() for name in ("t_us", "id", "length", "flags"))
    for k, (t_us, record_id, length, flags) in enumerate(zip(*columns, strict=True)):
        seconds, micro = divmod(t_us, 1_000_000)
        frame_id = f"{record_id & ~EXTENDED:08X}" if record_id & EXTENDED else f"{record_id:03X}"
        kind = f"#{flags:X}" if length > CLASSIC_BYTES else ""
        begin = 2 * frames.data.shape[1] * k
        yield f"({seconds}.{micro:06d}) {bus} {frame_id}#{kind}{digits[begin : begin + 2 * length]} R\n"


def write_blf(path: Path, blocks: Sequence[tuple[str, FrameBlock]], channels: Mapping[str, int]) -> None:
    """Write a complete .blf file with frames of several buses; it keeps times to the microsecond and CAN FD.

    Args:
        path: the file; an existing one is replaced.
        blocks: blocks of at least one frame, with the names of their buses.
        channels: channel numbers of the buses, from 0 on, as the file has no names.

    Raises:
        RecordError: the file cannot be written.
    """
    try:
        with can.BLFWriter(path) as writer:
            # Set the start to the earliest frame: a frame before the start would get the time of the start.
            writer.start_timestamp = min(int(frames.t_us.min()) for _, frames in blocks) // 1000 / 1000
            for bus, frames in blocks:
                for frame in frames.frames():
                    writer.on_message_received(_message(frame, channels[bus]))
    except OSError as error:
        raise RecordError(f"cannot write {path}: {error.strerror}") from None


def _message(frame: Frame, channel: int) -> can.Message:
    is_fd = len(frame.data) > CLASSIC_BYTES
    return can.Message(
        timestamp=frame.t_us / 1e6,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        data=frame.data,
        is_fd=is_fd,
        bitrate_switch=is_fd,
        channel=channel,
    )


_TAIL = 4096
"""Bytes at the end of a log that contain its last lines."""


def span_s(path: Path) -> float:
    """Time from the first to the last frame in a file of ``FrameRecorder`` [s]; a torn last line is ignored.

    Raises:
        RecordError: the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            first = file.readline()
            file.seek(max(0, path.stat().st_size - _TAIL))
            lines = file.read().split(b"\n")[:-1]
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}") from None
    times = [_STAMP.match(line) for line in (first, lines[-1] if lines else b"")]
    if times[0] is None or times[1] is None:
        return 0.0
    return float(times[1][1]) - float(times[0][1])


_STAMP = re.compile(rb"\((\d+\.\d+)\) ")
