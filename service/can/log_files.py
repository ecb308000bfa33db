"""CAN logs of python-can (.log .asc .blf .trc): reading them as frames, and recording frames."""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NamedTuple, Self

import can
from can.io.blf import BLFParseError

from service.can.frames import Frame
from service.can.receivers import frame_of
from service.can.user_errors import RecordError

LOG_SUFFIXES = (".log", ".asc", ".blf", ".trc")
LOG_REASONS = ("error_frame", "remote_frame", "not_a_frame")
"""Why an entry of a log gave no frame.  not_a_frame: an event, or a line that nobody understands."""

_BLOCK = 256
_FAULTS = (
    *(ValueError, LookupError, TypeError, AttributeError, AssertionError, OverflowError, EOFError),
    *(struct.error, zlib.error, BLFParseError, NotImplementedError),
)


class LogBlock(NamedTuple):
    """Frames with the name or number of their bus as the log has it; how much has been read, 0 to 1."""

    frames: list[tuple[str, Frame]]
    done: float


class CanLog:
    """A log file.

    Raises:
        RecordError: it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.dropped = dict.fromkeys(LOG_REASONS, 0)
        self.frames = 0
        self._lines: _Lines | None = None
        try:
            self._size = max(1, path.stat().st_size)
            self._raw: BinaryIO = path.open("rb")
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror}") from None

    def blocks(self) -> Iterator[LogBlock]:
        """All frames in the order of the file.

        Raises:
            RecordError: the file is damaged; the text says where, and how many frames were read before.
        """
        with self._raw:
            messages = self._messages()
            while block := self._block(messages):
                yield LogBlock(block, self._done())
        if self._lines is not None:
            self.dropped["not_a_frame"] = max(
                0, self._lines.entries - self.frames - sum(self.dropped.values())
            )
        if not self.frames:
            raise RecordError(f"{self.path}: no CAN frames in it")

    def _done(self) -> float:
        # python-can closes the file at its end.
        return 1.0 if self._raw.closed else min(1.0, self._raw.tell() / self._size)

    def _block(self, messages: Iterator[can.Message]) -> list[tuple[str, Frame]]:
        block: list[tuple[str, Frame]] = []
        while len(block) < _BLOCK:
            try:
                message = next(messages, None)
                frame = None if message is None else frame_of(message, stored=True)
            except _FAULTS as error:
                if self._lines is not None and self._lines.torn:
                    break
                raise self._damaged(error) from None
            if message is None or frame is None:
                break
            if isinstance(frame, str):
                self.dropped[frame] += 1
            else:
                block.append((str(message.channel), frame))
                self.frames += 1
        return block

    def _messages(self) -> Iterator[can.Message]:
        try:
            return iter(self._reader())
        except _FAULTS as error:
            raise self._damaged(error) from None

    def _reader(self) -> Iterable[can.Message]:
        suffix = self.path.suffix.lower()
        if suffix == ".blf":
            reader = can.BLFReader(self._raw)
            if reader.file_size > self._size:
                raise ValueError(f"cut off, {self._size} of {reader.file_size} bytes")
            return reader
        self._lines = _Lines(self._raw)
        if suffix == ".asc":
            return can.ASCReader(self._lines, relative_timestamp=False)
        return can.TRCReader(self._lines) if suffix == ".trc" else can.CanutilsLogReader(self._lines)

    def _damaged(self, error: Exception) -> RecordError:
        why = str(error) or type(error).__name__
        if self._lines is None:
            where = f"{self.path} is damaged or no {self.path.suffix} file"
        else:
            where, why = f"{self.path}, line {self._lines.number}", f"not understood: {self._lines.text()!r}"
        return RecordError(f"{where}: {why} ({self.frames} frames were read before it)")


class _Lines(io.TextIOWrapper):
    """Lines for python-can's readers: counted for messages, and with blanks for tabulators."""

    def __init__(self, raw: BinaryIO) -> None:
        super().__init__(raw, encoding="utf-8", errors="replace")
        self._raw = raw
        self._line = b""
        self.number = 0
        self.entries = 0
        """Lines that are no comment and no head: they begin with a time or a number."""

    def __next__(self) -> str:  # type: ignore[override] # as in every text file
        line = self._raw.readline()
        if not line:
            raise StopIteration
        self._line = line
        self.number += 1
        self.entries += line.lstrip()[:1].isdigit() or line[:1] == b"("
        return line.decode("utf-8", "replace").replace("\t", " ")

    @property
    def torn(self) -> bool:
        """Whether the last line has no end, as where its writer was killed."""
        return bool(self._line) and not self._line.endswith(b"\n")

    def text(self) -> str:
        """The last line, not too long."""
        text = self._line.decode("utf-8", "replace").strip()
        return text if len(text) <= 60 else text[:57] + "..."


# --- recording ------------------------------------------------------------------------------------------


class FrameRecorder:
    """Writes a candump log (.log), which keeps frames exactly: times to the microsecond, name of the bus, CAN FD.

    The other formats of python-can lose some of this and are refused: .asc rounds the start to milliseconds, .trc has
    no CAN FD, .blf has no names of buses and writes nothing to the disk before 128 KiB.

    Raises:
        RecordError: another format, or a file that exists or cannot be written.
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
        self._writer = can.CanutilsLogWriter(self._file)
        self._writer.last_timestamp = 0.0  # otherwise times before that of the first frame are changed

    def write(self, bus: str, frames: Iterable[Frame]) -> None:
        """Write frames of a bus; they are in the file when this returns.

        Raises:
            RecordError: the disk does not take them.
        """
        try:
            for frame in frames:
                self._writer.on_message_received(_message(bus, frame))
            self._file.flush()
        except OSError as error:
            raise self._error(error) from None

    def close(self) -> None:
        """Close the file; a second time does nothing.

        Raises:
            RecordError: the disk does not take what is left; the file is closed nevertheless.
        """
        try:
            self._writer.stop()
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: OSError) -> RecordError:
        return RecordError(f"cannot write {self.path}: {error.strerror}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _1: type[BaseException] | None, _2: object, _3: TracebackType | None) -> None:
        self.close()


def _message(bus: str, frame: Frame) -> can.Message:
    return can.Message(
        timestamp=frame.t_us / 1e6,
        channel=bus,
        arbitration_id=frame.can_id,
        is_extended_id=frame.extended,
        is_fd=len(frame.data) > 8,
        data=frame.data,
    )


_TAIL = 4096
"""Bytes that hold the last lines of a log."""


def span_s(path: Path) -> float:
    """Seconds from the first to the last frame that ``FrameRecorder`` has written to a file; a torn last line is none.

    Raises:
        RecordError: it cannot be read.
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
