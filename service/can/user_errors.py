"""Errors that a user can cause and correct; and what is accepted where a part of a record cannot be read."""

from collections.abc import Sequence
from pathlib import Path


class IngestError(Exception):
    """Something outside the program is wrong; the text names it and says what would be right."""


class BusError(IngestError):
    """A bus that cannot be opened or written to."""


class RecordError(IngestError):
    """A record that cannot be read, played or written."""


# --- Parts of a record that cannot be read: how much of it is accepted, and how it is reported ------------------------


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
