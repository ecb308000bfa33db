"""The bytes of a log file, plain or compressed with gzip, with what is wrong at their end."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from can.io.blf import BLFParseError

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
