"""CAN logs of python-can (.log .asc .blf .trc): reading them as frames, and recording frames."""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NamedTuple, Self

import can
import numpy as np
from can.io.blf import BLFParseError

from monitor_core.arrays import Ints
from service.can.candump import ERROR, Parsed, parse_lines
from service.can.frames import CLASSIC_BYTES, EXTENDED, Frame, FrameBlock, concatenate_frames
from service.can.receivers import frame_of
from service.can.user_errors import RecordError

LOG_SUFFIXES = (".log", ".asc", ".blf", ".trc")
LOG_REASONS = ("error_frame", "remote_frame", "not_a_frame")
"""Why an entry of a log gave no frame.  not_a_frame: an event, or a line that nobody understands."""

_BLOCK = 256
_PIECE = 256 * 1024
"""Bytes of a log of lines that are looked at together"""
_FAULTS = (
    *(ValueError, LookupError, TypeError, AttributeError, AssertionError, OverflowError, EOFError),
    *(struct.error, zlib.error, BLFParseError, NotImplementedError),
)


class LogBlock(NamedTuple):
    """Frames of all buses, in the order of the file."""

    frames: FrameBlock
    channels: Ints
    """Of each frame (N,): which of the names"""
    names: tuple[str, ...]
    """Of the buses, as the log has them; some are numbers"""
    done: float
    """How much of the file has been read, 0 to 1"""


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
            if self.path.suffix.lower() == ".log":
                yield from self._pieces()
            else:
                yield from self._by_messages()
        if not self.frames:
            raise RecordError(f"{self.path}: no CAN frames in it")

    # --- candump logs: many lines at once ---------------------------------------------------------------------------

    def _pieces(self) -> Iterator[LogBlock]:
        rest, first = b"", 0
        while piece := self._raw.read(_PIECE):
            text, end, rest = (rest + piece).rpartition(b"\n")
            if end:
                yield from self._piece(text + end, first)
                first += text.count(b"\n") + 1
        if rest:  # its writer was killed, or the disk was full
            yield from self._piece(rest + b"\n", first, torn=True)

    def _piece(self, text: bytes, first: int, torn: bool = False) -> Iterator[LogBlock]:
        """The frames of whole lines, of which the first one has that number, from 0."""
        parsed = parse_lines(text)
        self.dropped["error_frame"] += len(parsed.errors)
        fault: _Fault | None = None
        if len(parsed.odd):
            odd, fault = self._odd_lines(text, parsed.odd)
            parsed = _joined(parsed, odd, fault)
        if parsed.frames.size:
            self.frames += parsed.frames.size
            done = min(1.0, self._raw.tell() / self._size)
            yield LogBlock(parsed.frames, parsed.channels, parsed.names, done)
        if fault is not None and torn:
            self.dropped["not_a_frame"] += 1
        elif fault is not None:
            where = f"{self.path}, line {first + fault.line + 1}"
            raise self._fault(where, f"not understood: {fault.text!r}")

    def _odd_lines(self, text: bytes, numbers: Ints) -> tuple[list[_OddFrame], _Fault | None]:
        """The frames in lines of these numbers, by python-can, up to the first one that it does not understand."""
        all_lines, frames = text.split(b"\n"), list[_OddFrame]()
        lines = _Lines(io.BytesIO(b"".join(all_lines[number] + b"\n" for number in numbers)))
        messages = iter(can.CanutilsLogReader(lines))
        try:
            while (message := next(messages, None)) is not None:
                frame, line = frame_of(message, stored=True), int(numbers[lines.number - 1])
                if isinstance(frame, str) or lines.is_error:
                    self.dropped[frame if isinstance(frame, str) else "error_frame"] += 1
                else:
                    frames.append(_OddFrame(line, str(message.channel), frame))
        except _FAULTS:
            return frames, _Fault(int(numbers[lines.number - 1]), lines.text())
        return frames, None

    # --- the other formats: message by message ----------------------------------------------------------------------

    def _by_messages(self) -> Iterator[LogBlock]:
        messages = self._messages()
        while block := self._block(messages):
            names, channels = _numbered([channel for channel, _ in block])
            frames = FrameBlock.from_frames([frame for _, frame in block])
            yield LogBlock(frames, channels, names, self._done())
        if self._lines is not None:
            self.dropped["not_a_frame"] = max(
                0, self._lines.entries - self.frames - sum(self.dropped.values())
            )

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
        return can.TRCReader(self._lines)

    def _damaged(self, error: Exception) -> RecordError:
        why = str(error) or type(error).__name__
        if self._lines is None:
            where = f"{self.path} is damaged or no {self.path.suffix} file"
        else:
            where, why = f"{self.path}, line {self._lines.number}", f"not understood: {self._lines.text()!r}"
        return self._fault(where, why)

    def _fault(self, where: str, why: str) -> RecordError:
        return RecordError(f"{where}: {why} ({self.frames} frames were read before it)")


class _OddFrame(NamedTuple):
    line: int
    channel: str
    frame: Frame


class _Fault(NamedTuple):
    line: int
    text: str


def _joined(parsed: Parsed, odd: Sequence[_OddFrame], fault: _Fault | None) -> Parsed:
    """All frames in the order of their lines, up to the fault."""
    names, channels = _numbered([frame.channel for frame in odd], parsed.names)
    lines = np.concatenate([parsed.lines, np.array([frame.line for frame in odd], np.int64)])
    order = np.argsort(lines, kind="stable")
    if fault is not None:
        order = order[lines[order] < fault.line]
    frames = concatenate_frames([parsed.frames, FrameBlock.from_frames([frame.frame for frame in odd])])
    return parsed._replace(
        frames=frames.select(order),
        lines=lines[order],
        channels=np.concatenate([parsed.channels, channels])[order],
        names=names,
    )


def _numbered(channels: Sequence[str], names: tuple[str, ...] = ()) -> tuple[tuple[str, ...], Ints]:
    """The different names, those known first, and which of them each channel has."""
    found = tuple(dict.fromkeys((*names, *channels)))
    number = {name: place for place, name in enumerate(found)}
    return found, np.array([number[channel] for channel in channels], np.int64)


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

    @property
    def is_error(self) -> bool:
        """Whether the last line, of a candump log, is an error frame; python-can takes most of them for data."""
        frame_id = self._line.decode("utf-8", "replace").split()[2].partition("#")[0]
        return len(frame_id) > 3 and bool(int(frame_id, 16) & ERROR)

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

    def write(self, bus: str, frames: FrameBlock) -> None:
        """Write frames of a bus; they are in the file when this returns.

        Raises:
            RecordError: the disk does not take them.
        """
        try:
            self._file.writelines(_log_lines(bus, frames))
            self._file.flush()
        except OSError as error:
            raise self._error(error) from None

    def close(self) -> None:
        """Close the file; a second time does nothing.

        Raises:
            RecordError: the disk does not take what is left; the file is closed nevertheless.
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
    bus = f"can{bus}" if bus.isdigit() else bus  # a number alone would be read as one
    records, digits = frames.records, frames.data.tobytes().hex().upper()
    columns = (records[name].tolist() for name in ("t_us", "id", "length", "flags"))
    for k, (t_us, record_id, length, flags) in enumerate(zip(*columns, strict=True)):
        seconds, micro = divmod(t_us, 1_000_000)
        frame_id = f"{record_id & ~EXTENDED:08X}" if record_id & EXTENDED else f"{record_id:03X}"
        kind = f"#{flags:X}" if length > CLASSIC_BYTES else ""
        begin = 2 * frames.data.shape[1] * k
        yield f"({seconds}.{micro:06d}) {bus} {frame_id}#{kind}{digits[begin : begin + 2 * length]} R\n"


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
