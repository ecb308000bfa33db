"""Reads frames from CAN logs (.log .asc .blf .trc .mf4 .csv, each also compressed as .gz)."""

from __future__ import annotations

import io
import logging
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import BinaryIO, NamedTuple, cast

import can
import numpy as np
from can.io.blf import BLFParseError

from monitor_core.arrays import Ints
from service.can.candump import CSV_HEAD, SAVVYCAN_HEAD, Parsed, parse_lines, rewritten
from service.can.frames import CLASSIC_BYTES, FD_BYTES, Frame, FrameBlock, concatenate_frames
from service.can.log_bytes import (
    GZIP,
    GZIP_START,
    LONGEST_LINE,
    BlfObjects,
    CompleteReads,
    LogBytes,
    LogLines,
    line_text,
)
from service.can.mf4_frames import Mf4Frames
from service.can.receivers import frame_of
from service.can.user_errors import RecordError, too_many

_CSV = ".csv"
"""Suffix of logs of python-can and SavvyCAN; other .csv files are tables"""
LOG_SUFFIXES = (".log", ".asc", ".blf", ".trc", ".mf4", _CSV)
LOG_REASONS = ("error_frame", "remote_frame", "not_a_frame", "unreadable")
"""Why an entry of a log gave no frame.  not_a_frame: an event, or a line of unknown form; unreadable: damaged."""

_BLOCK = 256
PIECE = 256 * 1024
"""Bytes of a log of lines that are parsed together"""
_OBJECT = 64 * 1024
"""Longer than any object with a CAN frame in a BLF file, in bytes."""
_FAULTS = (
    *(ValueError, LookupError, TypeError, AttributeError, AssertionError, OverflowError, EOFError),
    *(struct.error, zlib.error, BLFParseError, NotImplementedError),
)

_STARTS = {
    b"(": ".log",
    b"date ": ".asc",
    b"LOGG": ".blf",
    b";$FILEVERSION": ".trc",
    b"MDF ": ".mf4",
    GZIP_START: GZIP,
}
"""The first bytes of a log, with its kind"""

# Silence the .trc reader: it prints every line that it does not understand, and these are reported here with their
# numbers.
logging.getLogger("can.io.trc").setLevel(logging.CRITICAL)


def log_suffix(path: Path) -> str:
    """The kind of a CAN log, by the name of the file: ".blf" for "a.BLF.gz"; empty: no CAN log."""
    suffix = Path(path.name.lower().removesuffix(GZIP)).suffix
    return suffix if suffix in LOG_SUFFIXES and (suffix != _CSV or _has_frames(path)) else ""


def _has_frames(path: Path) -> bool:
    """Whether the first line of a .csv file is that of a CAN log."""
    try:
        with closing(LogBytes(path)) as file:
            return file.stream.readline(LONGEST_LINE).startswith((CSV_HEAD, SAVVYCAN_HEAD))
    except OSError:
        return False


class LogBlock(NamedTuple):
    """A block of frames of all buses, in the order of the file."""

    frames: FrameBlock
    channels: Ints
    """Index of the bus name of each frame (N,)"""
    names: tuple[str, ...]
    """Names of the buses in the log; some formats have numbers"""
    done: float
    """Part of the file that has been read, 0 to 1"""


class CanLog:
    """A log file.

    Raises:
        RecordError: the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.dropped = dict.fromkeys(LOG_REASONS, 0)
        self.frames = 0
        self.left_out: list[str] = []
        """Places that could not be read, with their faults; complete when all blocks have been read"""
        self._damaged_lines = 0
        try:
            self._bytes = LogBytes(path)
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror}") from None

    def blocks(self) -> Iterator[LogBlock]:
        """Read all frames in the order of the file.

        Unreadable lines, up to one in a hundred, and a cut-off end are left out; see ``left_out``.

        Raises:
            RecordError: more is damaged; the text says where, and how many frames were read.
        """
        suffix = log_suffix(self.path)
        with closing(self._bytes):
            try:
                if suffix in (".log", _CSV):
                    yield from self._pieces()
                elif suffix == ".mf4":
                    yield from self._measurement()
                else:
                    entries = self._objects() if suffix == ".blf" else self._lines(suffix)
                    yield from self._blocks(entries)
            except OSError as error:
                raise self._fault(f"cannot read {self.path}", str(error.strerror or error)) from None
        if self._bytes.damage:
            raise self._fault(f"{self.path} is damaged", self._bytes.damage)
        self._check_share(ended=True)
        if self._bytes.cut:
            self._leave_out(self._bytes.cut)
        if not self.frames:
            raise RecordError(f"{self.path}: no CAN frames in it{self._other_kind()}")

    def _leave_out(self, what: str) -> None:
        self.left_out.append(what)
        self.dropped["unreadable"] += 1

    def _leave_out_line(self, number: int, text: str, torn: bool) -> None:
        """Leave out a line; ``number``: from 1 on; ``torn``: the line was cut off, so it does not count as damaged."""
        self._leave_out(f"line {number}: not understood: {text!r}")
        self._damaged_lines += not torn

    def _check_share(self, ended: bool = False) -> None:
        if too_many(self._damaged_lines, self.frames, ended):
            more = self._damaged_lines - 1
            where = f"{self.path}, {self.left_out[0]}" + (f", and {more} further lines" if more else "")
            raise self._fault(where, "more than 1 in 100 lines cannot be read")

    def _fault(self, where: str, why: str) -> RecordError:
        return RecordError(f"{where}: {why} ({self.frames} frames were read){self._other_kind()}")

    def _other_kind(self) -> str:
        """A hint if nothing was read and the content does not fit the suffix of the name; empty otherwise."""
        if self.frames:
            return ""
        suffix = log_suffix(self.path)
        kind = next((kind for start, kind in _STARTS.items() if self._bytes.start.startswith(start)), suffix)
        is_packed = self.path.name.lower().endswith(GZIP)
        if kind == GZIP:
            return "" if is_packed else f"; its content is compressed: let its name end with {suffix}{GZIP}"
        if kind != suffix or is_packed:
            return f"; its content is that of a {kind} file: let its name end so"
        return ""

    # --- candump logs: many lines at a time -------------------------------------------------------------------------

    def _pieces(self) -> Iterator[LogBlock]:
        head = self._bytes.stream.readline(LONGEST_LINE)
        begin, first, rest = head, 0, b""
        if head.startswith((CSV_HEAD, SAVVYCAN_HEAD)):
            begin, first = b"", 1
        read = partial(self._bytes.stream.read, PIECE)
        for piece in chain([begin + read()], iter(read, b"")):
            text, end, rest = (rest + piece).rpartition(b"\n")
            if end:
                yield from self._piece(rewritten(text + end, head), first)
                first += text.count(b"\n") + 1
            if len(rest) > LONGEST_LINE:
                yield from self._piece(rest + b"\n", first)
                rest = b""
        if rest and self._bytes.cut:  # do not parse it, as a cut line may look like a shorter frame
            self._leave_out_line(first + 1, line_text(rest), torn=True)
        elif rest:
            yield from self._piece(rewritten(rest + b"\n", head), first, torn=True)

    def _piece(self, text: bytes, first: int, torn: bool = False) -> Iterator[LogBlock]:
        """The frames of complete lines; ``first``: number of the first line, from 0 on."""
        parsed = parse_lines(text)
        self.dropped["error_frame"] += len(parsed.errors)
        if len(parsed.odd):
            odd = self._odd_lines(text, parsed.odd, first, torn)
            parsed = _joined(parsed, odd) if odd else parsed
        if parsed.frames.size:
            self.frames += parsed.frames.size
            yield LogBlock(parsed.frames, parsed.channels, parsed.names, self._bytes.done)
        self._check_share()

    def _odd_lines(self, text: bytes, numbers: Ints, first: int, torn: bool) -> list[_OddFrame]:
        """The frames in the lines with these numbers, read by python-can."""
        all_lines, frames = text.split(b"\n"), list[_OddFrame]()
        odd = (all_lines[number][: LONGEST_LINE - 1] + b"\n" for number in numbers)
        lines = LogLines(io.BytesIO(b"".join(odd)))
        while True:  # a new reader after each line that cannot be read
            messages = iter(can.CanutilsLogReader(lines))
            try:
                while (message := next(messages, None)) is not None:
                    frame, line = frame_of(message, stored=True), int(numbers[lines.number - 1])
                    if isinstance(frame, str) or lines.is_error:
                        self.dropped[frame if isinstance(frame, str) else "error_frame"] += 1
                    else:
                        frames.append(_OddFrame(line, str(message.channel), frame))
                return frames
            except _FAULTS:
                number = first + int(numbers[lines.number - 1]) + 1
                self._leave_out_line(number, lines.text(), torn)

    # --- Other formats: message by message --------------------------------------------------------------------------

    def _blocks(self, entries: Iterator[_Entry]) -> Iterator[LogBlock]:
        fault: RecordError | None = None
        full = True
        while full:
            block = list[_Entry]()
            try:
                for entry in islice(entries, _BLOCK):
                    block.append(entry)  # one by one, so that a fault does not lose the entries before it
            except RecordError as error:
                fault = error
            if block:
                names, channels = _numbered([channel for channel, _ in block])
                frames = FrameBlock.from_frames([frame for _, frame in block])
                yield LogBlock(frames, channels, names, self._bytes.done)
            full = len(block) == _BLOCK
        if fault is not None:
            raise fault

    def _entry(self, message: can.Message) -> Iterator[_Entry]:
        """The frame in a message, if the message has one."""
        frame = frame_of(message, stored=True)
        if isinstance(frame, str):
            self.dropped[frame] += 1
        else:
            self.frames += 1
            yield str(message.channel), frame

    def _lines(self, suffix: str) -> Iterator[_Entry]:
        """The frames in the lines of an .asc or .trc file."""
        lines, ended, is_trc = LogLines(self._bytes.stream), False, suffix == ".trc"
        before = -1
        try:
            while not ended:
                try:
                    for message in can.TRCReader(lines) if is_trc else can.ASCReader(lines, relative_timestamp=False):
                        _check_length(message)
                        if is_trc:  # its channels start at 1; those of the other formats start at 0 here
                            message.channel = int(str(message.channel)) - 1
                        yield from self._entry(message)
                    ended = True
                except _FAULTS:
                    # No new line since the last fault: the head alone cannot be read.
                    at_end = lines.number == before
                    if not at_end:
                        self._leave_out_line(lines.number, lines.text(), lines.torn)
                    if at_end or lines.is_head:
                        raise self._fault(f"{self.path}, {self.left_out[-1]}", "the head is damaged") from None
                    self._check_share()
                    before = lines.number
                    lines.repeat_head()
        finally:
            unknown = lines.entries - self.frames - sum(self.dropped.values())
            self.dropped["not_a_frame"] += max(0, unknown)

    def _objects(self) -> Iterator[_Entry]:
        """The frames in the objects of a .blf file."""
        file = CompleteReads(self._bytes.stream)
        size = objects = tail = 0
        try:
            reader = _BlfReader(cast(BinaryIO, file))
            size, objects = reader.file_size, reader.object_count
            for message in reader:
                yield from self._entry(message)
            tail = len(reader._tail.strip(b"\0"))
        except _FAULTS as error:
            if not file.ended:
                where = f"{self.path} is damaged or no .blf file"
                raise self._fault(where, f"{str(error) or type(error).__name__}, before byte {file.position}") from None
        if tail > _OBJECT:
            raise self._fault(f"{self.path} is damaged", f"an object claims more than {_OBJECT} bytes")
        if file.cut or file.position < size or tail:
            of_size = f" of {size}" if size > file.position else ""
            self._leave_out(f"cut off after byte {file.position}{of_size}")
        else:
            self.dropped["not_a_frame"] += max(0, objects - self.frames - sum(self.dropped.values()))

    # --- .mf4: by asammdf -------------------------------------------------------------------------------------------

    def _measurement(self) -> Iterator[LogBlock]:
        stream = self._bytes.stream
        try:
            content = stream if stream.seekable() else io.BytesIO(stream.read())
            with closing(Mf4Frames(self.path, content)) as file:
                for reason, count in file.rejected.items():
                    self.dropped[reason] += count
                for frames, numbers, done in file.parts():
                    self.frames += frames.size
                    names, channels = np.unique(numbers, return_inverse=True)
                    yield LogBlock(frames, channels.astype(np.int64), tuple(map(str, names.tolist())), done)
        except (RecordError, GeneratorExit):
            raise
        except Exception as error:  # asammdf does not document what it raises for a damaged file
            where = f"{self.path} is damaged or no .mf4 file"
            raise self._fault(where, str(error) or type(error).__name__) from None


_Entry = tuple[str, Frame]
"""Channel and frame"""


class _BlfReader(can.BLFReader):
    def _parse_data(self, data: bytes) -> Iterator[can.Message]:
        return super()._parse_data(BlfObjects(data))


def _check_length(message: can.Message) -> None:
    """Check that a line has as many bytes as its length says."""
    most = FD_BYTES if message.is_fd else CLASSIC_BYTES
    is_data = not (message.is_remote_frame or message.is_error_frame)
    if is_data and not 0 <= min(message.dlc, most) <= len(message.data):
        raise ValueError("bytes are missing")


class _OddFrame(NamedTuple):
    line: int
    channel: str
    frame: Frame


def _joined(parsed: Parsed, odd: Sequence[_OddFrame]) -> Parsed:
    """Merge the parsed frames and the odd ones in the order of their lines."""
    names, channels = _numbered([frame.channel for frame in odd], parsed.names)
    lines = np.concatenate([parsed.lines, np.array([frame.line for frame in odd], np.int64)])
    order = np.argsort(lines, kind="stable")
    frames = concatenate_frames([parsed.frames, FrameBlock.from_frames([frame.frame for frame in odd])])
    return parsed._replace(
        frames=frames.select(order),
        lines=lines[order],
        channels=np.concatenate([parsed.channels, channels])[order],
        names=names,
    )


def _numbered(channels: Sequence[str], names: tuple[str, ...] = ()) -> tuple[tuple[str, ...], Ints]:
    """The distinct names, known ones first, and the index of each channel's name."""
    found = tuple(dict.fromkeys((*names, *channels)))
    number = {name: place for place, name in enumerate(found)}
    return found, np.array([number[channel] for channel in channels], np.int64)
