"""What cannot be read in a record: how much of it is accepted, and how it is reported."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

_MOST = 0.01
"""Share of the lines of a record: where more cannot be read, the others cannot be trusted either."""
_SOME = 20
"""Lines that may be left out before a share of them is too many."""


def too_many(left_out: int, read: int, ended: bool = False) -> bool:
    """Whether more lines than one in a hundred cannot be read; before the end of a file a few are waited for."""
    most = _MOST * (read + left_out)
    return left_out > (most if ended else max(_SOME, most))


def left_out_words(path: Path | str, left_out: Sequence[str]) -> str:
    """A sentence about the parts of a file that could not be read, of which there are some."""
    more = len(left_out) - 1
    return f"{path}, {left_out[0]}: left out" + (f", and {more} more" if more else "")
