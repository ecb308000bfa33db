"""Lines of a log, as the readers of python-can ask for them."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import BinaryIO

from service.can.candump import ERROR

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
