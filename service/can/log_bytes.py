"""The bytes of a log file, plain or compressed with gzip, with what is wrong at their end; and its lines."""

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
"""Bytes of the head of an object; where none of them is left the file ends as it should."""
_PADDING = 3
"""Bytes behind an object at most; some writers leave them out at the end."""
_MOST = 1 << 20
"""Bytes that are asked for at once: a damaged length may claim anything."""


class LogBytes:
    """The bytes of a file, those inside if its name ends with .gz.

    Raises:
        OSError: it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("rb")
        self._size = max(1, path.stat().st_size)
        self.start = self._file.read(_START)
        """The first bytes of the file itself"""
        self._file.seek(0)
        self._gzip = _Gunzip(self._file) if path.suffix.lower() == GZIP else None
        self.stream: BinaryIO = self._file if self._gzip is None else io.BufferedReader(self._gzip)

    @property
    def done(self) -> float:
        """How much of the file has been read, 0 to 1."""
        return 1.0 if self._file.closed else min(1.0, self._file.tell() / self._size)

    @property
    def cut(self) -> str:
        """Where compressed data ends too early, as where its writer was killed; empty: it does not."""
        return "" if self._gzip is None else self._gzip.cut

    @property
    def damage(self) -> str:
        """What is wrong with compressed data, and where; empty: nothing."""
        return "" if self._gzip is None else self._gzip.damage

    def close(self) -> None:
        """Close the file; a second time does nothing."""
        self.stream.close()
        self._file.close()


class _Gunzip(io.RawIOBase):
    """What is compressed in a file; where that is damaged or cut off it ends, and all bytes before have been given."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._inside = file, gzip.GzipFile(fileobj=file)
        self.cut = self.damage = ""

    def readable(self) -> bool:
        """As of every file that is read."""
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
    """A file of which a part is read completely or not at all: what is cut off at the end is as if it were not there.

    For python-can's reader of BLF files, which would take the rest of a cut container for a container.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.position = 0
        """Bytes that were read"""
        self.ended = False
        """Whether there was less than was asked for"""
        self.cut = False
        """Whether it ended within an object"""

    def readable(self) -> bool:
        """As of every file that is read."""
        return True

    def read(self, size: int = -1) -> bytes:
        """So many bytes, or none if there are fewer.

        Raises:
            ValueError: less than nothing is asked for, as a damaged length does.
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
    """The objects in a container of a BLF file, for python-can's reader, which asks for the index of one after another.

    Where an object has no length, it would come to the same one for ever.
    """

    _last = -1

    def index(self, *words: Any) -> int:
        """As of all bytes.

        Raises:
            BLFParseError: it is the same object again.
            ValueError: there is none.
        """
        found = super().index(*words)
        if found <= self._last:
            raise BLFParseError("an object without a length")
        self._last = found
        return found


# --- Lines of a log, as the readers of python-can ask for them --------------------------------------------------------


LONGEST_LINE = 1 << 16
"""Bytes; in a file full of zeros, as after a power failure, there is no end of a line."""
_HEAD = re.compile(rb"\s*(;\$|date\s|base\s|(no\s+)?internal\s+events|begin\s+triggerblock)", re.IGNORECASE)
_COMMENT = re.compile(rb"\s*(;|//|end\s+triggerblock|$)", re.IGNORECASE)


class LogLines(io.TextIOWrapper):
    """Lines for python-can's readers: counted for messages, and with blanks for tabulators.

    A reader that has met a line which it does not understand is of no use any more.  Another one goes on behind that
    line: ``again`` lets it read the lines of the head first.
    """

    def __init__(self, raw: BinaryIO) -> None:
        super().__init__(raw, encoding="utf-8", errors="replace")
        self._raw = raw
        self._line = b""
        self._head = list[bytes]()
        self._repeated: Iterator[bytes] = iter(())
        self.number = 0
        self.entries = 0
        """Lines that are no comment and no head"""
        self.is_head = False
        """Whether the last line belongs to the head"""

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

    def again(self) -> None:
        """The next lines are those of the head, then those that are left."""
        self._repeated = iter([*self._head, b"\n"])  # python-can looks for the head up to a line that is none

    @property
    def torn(self) -> bool:
        """Whether the last line has no end, as where its writer was killed."""
        return 0 < len(self._line) < LONGEST_LINE and not self._line.endswith(b"\n")

    @property
    def is_error(self) -> bool:
        """Whether the last line, of a candump log, is an error frame; python-can takes most of them for data."""
        frame_id = self._line.decode("utf-8", "replace").split()[2].partition("#")[0]
        return len(frame_id) > 3 and bool(int(frame_id, 16) & ERROR)

    def text(self) -> str:
        """The last line, not too long."""
        return line_text(self._line)


def line_text(line: bytes) -> str:
    """A line for messages, not too long."""
    text = line.decode("utf-8", "replace").strip()
    return text if len(text) <= 60 else text[:57] + "..."
