"""Long work in Python that keeps no other thread waiting."""

import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

_EVERY_S, _PAUSE_S = 0.005, 0.0001

_T = TypeVar("_T")


def giving_way(parts: Iterable[_T]) -> Iterator[_T]:
    """These parts of the work, with a pause in between as soon as they have taken five milliseconds.

    A thread that waits for the interpreter gets it after a switch interval, unless it is let go in between.  numpy,
    sqlite and the kernel let it go for some microseconds, and take it back before the other has woken up, for each of
    a thousand axes: the event loop waited for all of them, up to 0.1 s.
    """
    due_s = time.perf_counter() + _EVERY_S
    for part in parts:
        yield part
        if time.perf_counter() >= due_s:
            time.sleep(_PAUSE_S)
            due_s = time.perf_counter() + _EVERY_S
