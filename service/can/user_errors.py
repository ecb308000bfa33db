"""Errors of buses and records that a user can cause and correct, and the tolerance for unreadable parts of records."""

from collections.abc import Sequence
from pathlib import Path


class IngestError(Exception):
    """A fault outside the program; the text names it and says how to correct it."""


class BusError(IngestError):
    """A bus cannot be opened or written to.

    Args:
        text: names the bus, and says why and what to do.
        why: the same without the name of the bus, for places that name it anyway; None: the text.
    """

    def __init__(self, text: str, why: str | None = None) -> None:
        super().__init__(text)
        self.why = text if why is None else why


class RecordError(IngestError):
    """A record cannot be read, played or written."""


# --- Unreadable parts of a record -------------------------------------------------------------------------------------


_MOST = 0.01
"""Largest share of unreadable lines; with more, the other lines cannot be trusted either."""
_SOME = 20
"""Number of unreadable lines that is accepted before the end of the file, whatever their share."""


def too_many(left_out: int, read: int, ended: bool = False) -> bool:
    """Whether more than one line in a hundred is unreadable; ``ended``: the whole file has been read."""
    most = _MOST * (read + left_out)
    return left_out > (most if ended else max(_SOME, most))


def left_out_words(path: Path | str, left_out: Sequence[str]) -> str:
    """A sentence about the unreadable parts of a file (at least one)."""
    more = len(left_out) - 1
    return f"{path}, {left_out[0]}: left out" + (f", and {more} more" if more else "")


# --- A bus without the expected frames --------------------------------------------------------------------------------


def silent_words(where: str, seconds: str) -> str:
    """What to check on a bus that sent no frame in that time."""
    return (
        f"{where} is silent: no frame in {seconds} s; is the controller on, does it send, and are cable, termination"
        " and bit rate right?"
    )


def undescribed_words(frames: str, description: object, identifiers: str) -> str:
    """What to check if ``frames`` were received, and none of their messages is described."""
    return (
        f"{frames}, and none of their messages is in {description}: {identifiers}; does that describe this robot, and"
        " this bus?"
    )
