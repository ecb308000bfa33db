"""Reads the bytes and lines of a log file, plain or compressed with gzip, and finds damage and cut ends."""

import gzip
import io
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from can.io.blf import BLFParseError

from service.can.candump import ERROR

GZIP, GZIP_START = ".gz", b"\x1f\x8b"
_START = 16
_BLF_HEAD = 16
"""Length of an object's head; a file that ends before a head ends correctly."""
_PADDING = 3
"""Most padding bytes after an object; some writers omit them at the end of the file."""
_MOST = 1 << 20
"""Most bytes in one read, as a damaged length may have any value."""


class LogBytes:
    """The bytes of a file, decompressed if its name ends with .gz.

    Raises:
        OSError: the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("rb")
        self._size = max(1, path.stat().st_size)
        self.start = self._file.read(_START)
        """The first bytes of the file, not decompressed"""
        self._file.seek(0)
        self._gzip = _Gunzip(self._file) if path.suffix.lower() == GZIP else None
        self.stream: BinaryIO = self._file if self._gzip is None else io.BufferedReader(self._gzip)

    @property
    def done(self) -> float:
        """Part of the file that has been read, 0 to 1."""
        return 1.0 if self._file.closed else min(1.0, self._file.tell() / self._size)

    @property
    def cut(self) -> str:
        """Where compressed data ends too early, such as after a killed writer; empty: the data is complete."""
        return "" if self._gzip is None else self._gzip.cut

    @property
    def damage(self) -> str:
        """The damage of compressed data, and its position; empty: none."""
        return "" if self._gzip is None else self._gzip.damage

    def close(self) -> None:
        """Close the file; a second time does nothing."""
        self.stream.close()
        self._file.close()


class _Gunzip(io.RawIOBase):
    """The decompressed data of a file, up to the place where it is damaged or cut off."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._inside = file, gzip.GzipFile(fileobj=file)
        self.cut = self.damage = ""

    def readable(self) -> bool:
        """Whether bytes can be read."""
        return True

    def readinto(self, buffer: Any) -> int:
        view, piece = memoryview(buffer).cast("B"), b""
        try:
            if not (self.damage or self.cut):
                piece = self._inside.read1(len(view))
        except EOFError:
            self.cut = f"the compressed data ends too early, at byte {self._file.tell()}"
        except (gzip.BadGzipFile, zlib.error) as error:
            at = self._file.tell()
            self.damage = f"damaged before byte {at} of the compressed ones, or no gzip ({error})"
        view[: len(piece)] = piece
        return len(piece)


class CompleteReads(io.RawIOBase):
    """A file whose reads return all requested bytes or none, so that a cut-off object at the end does not appear.

    For python-can's reader of BLF files, which would take a cut container for a whole one.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.position = 0
        """Number of bytes read"""
        self.ended = False
        """Whether a read requested more than was left"""
        self.cut = False
        """Whether the file ended within an object"""

    def readable(self) -> bool:
        """Whether bytes can be read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """Read ``size`` bytes; returns none if fewer are left.

        Raises:
            ValueError: the size is negative, from a damaged length.
        """
        if size < 0:
            raise ValueError("the length of an object is wrong")
        parts, left = list[bytes](), size
        while left and (part := self._file.read(min(left, _MOST))):
            parts.append(part)
            left -= len(part)
        if left:
            if size > _PADDING:
                self.ended = True
                self.cut |= bool(parts) or size != _BLF_HEAD
            return b""
        self.position += size
        return b"".join(parts)


class BlfObjects(bytes):
    """The objects in a container of a BLF file, for python-can's reader, which searches for one object after another.

    If an object has length zero, the reader would find the same object without end.
    """

    _last = -1

    def index(self, *words: Any) -> int:
        """Like ``bytes.index``.

        Raises:
            BLFParseError: the same object was found again.
            ValueError: there is no further object.
        """
        found = super().index(*words)
        if found <= self._last:
            raise BLFParseError("an object without a length")
        self._last = found
        return found


# --- Lines of a log, for the readers of python-can --------------------------------------------------------------------


LONGEST_LINE = 1 << 16
"""Most bytes of a line; a file full of zeros, as after a power failure, has no line breaks."""
_HEAD = re.compile(rb"\s*(;\$|date\s|base\s|(no\s+)?internal\s+events|begin\s+triggerblock)", re.IGNORECASE)
_COMMENT = re.compile(rb"\s*(;|//|end\s+triggerblock|$)", re.IGNORECASE)


class LogLines(io.TextIOWrapper):
    """Lines for python-can's readers: counted for error messages, with spaces instead of tabs.

    A reader that has failed on a line cannot continue.  A new reader continues after that line; ``repeat_head`` lets it
    read the lines of the head first.
    """

    def __init__(self, raw: BinaryIO) -> None:
        super().__init__(raw, encoding="utf-8", errors="replace")
        self._raw = raw
        self._line = b""
        self._head = list[bytes]()
        self._repeated: Iterator[bytes] = iter(())
        self.number = 0
        self.entries = 0
        """Number of lines that are neither comment nor head"""
        self.is_head = False
        """Whether the last line belongs to the head of the file"""

    def __next__(self) -> str:  # type: ignore[override] # as in every text file
        if (line := next(self._repeated, None)) is None:
            line = self._raw.readline(LONGEST_LINE)
            if not line:
                raise StopIteration
            self._line = line
            self.number += 1
            self.is_head = _HEAD.match(line) is not None
            if self.is_head:
                self._head.append(line)
            elif not _COMMENT.match(line):
                self.entries += 1
        return line.decode("utf-8", "replace").replace("\t", " ")

    def repeat_head(self) -> None:
        """Return the lines of the head again, then the remaining lines."""
        # python-can reads the head up to a line that does not belong to it.
        self._repeated = iter([*self._head, b"\n"])

    @property
    def torn(self) -> bool:
        """Whether the last line has no line break, e.g. as the writer was killed."""
        return 0 < len(self._line) < LONGEST_LINE and not self._line.endswith(b"\n")

    @property
    def is_error(self) -> bool:
        """Whether the last line of a candump log is an error frame; python-can takes most of them for data frames."""
        frame_id = self._line.decode("utf-8", "replace").split()[2].partition("#")[0]
        return len(frame_id) > 3 and bool(int(frame_id, 16) & ERROR)

    def text(self) -> str:
        """The last line, shortened for messages."""
        return line_text(self._line)


def line_text(line: bytes) -> str:
    """A line, shortened for messages."""
    text = line.decode("utf-8", "replace").strip()
    return text if len(text) <= 60 else text[:57] + "..."
