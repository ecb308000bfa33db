"""Pauses in long Python work, so that other threads need not wait for the interpreter lock."""

import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

_EVERY_S, _PAUSE_S = 0.005, 0.0001

_T = TypeVar("_T")


def with_pauses(parts: Iterable[_T]) -> Iterator[_T]:
    """Iterate over parts of the work; after every 5 ms, sleep for a moment before the next part.

    A waiting thread gets the interpreter lock after a switch interval (5 ms), but only if the lock is not released
    meanwhile. numpy, sqlite and the kernel release it for some microseconds and take it again before the waiting thread
    has woken up.  With a thousand axes, the event loop thus waited up to 0.1 s.
    """
    due_s = time.perf_counter() + _EVERY_S
    for part in parts:
        yield part
        if time.perf_counter() >= due_s:
            time.sleep(_PAUSE_S)
            due_s = time.perf_counter() + _EVERY_S
