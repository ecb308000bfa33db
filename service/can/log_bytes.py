"""The bytes of a log file, plain or compressed with gzip, with what is wrong at their end."""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any, BinaryIO

GZIP = ".gz"
_PIECE = 64 * 1024
_WITH_GZIP_HEADER = 31
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
        self._file = file
        self._inflate = zlib.decompressobj(_WITH_GZIP_HEADER)
        self._ready = b""
        self.cut = self.damage = ""

    def readable(self) -> bool:
        """As of every file that is read."""
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._ready and self._next():
            pass
        view = memoryview(buffer).cast("B")
        count = min(len(view), len(self._ready))
        view[:count] = self._ready[:count]
        self._ready = self._ready[count:]
        return count

    def _next(self) -> bool:
        """Decompress some more; False at the end."""
        if self.damage or self.cut:
            return False
        if self._inflate.eof:  # files that were appended to each other are read as one
            piece = self._inflate.unused_data.lstrip(b"\0") or self._file.read(_PIECE).lstrip(b"\0")
            if not piece:
                return False
            self._inflate = zlib.decompressobj(_WITH_GZIP_HEADER)
        else:
            piece = self._inflate.unconsumed_tail or self._file.read(_PIECE)
        try:
            self._ready = self._inflate.decompress(piece, _PIECE)
        except zlib.error as error:
            self.damage = (
                f"damaged before byte {self._file.tell()} of the compressed ones, or no gzip ({error})"
            )
            return False
        if not piece and not self._ready and not self._inflate.eof:
            self.cut = f"the compressed data ends too early, at byte {self._file.tell()}"
            return False
        return True


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
