"""Work on another core, while the caller goes on with its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import Generic, Self, TypeVar

T = TypeVar("T")
_TELL_S = 0.2


class _StoppedError(Exception):
    """The caller wants no more of it."""


class Beside(Generic[T]):
    """Begins with the ``with`` block, and ends with it at the latest: stopped, where the block fails.

    Args:
        work: what is to be done; it is given what to tell its progress to, 0 to 1, and is stopped when it does.
    """

    def __init__(self, work: Callable[[Callable[[float], None]], T]) -> None:
        self._work, self._part, self._stop = work, 0.0, threading.Event()
        self._pool = ThreadPoolExecutor(1)

    def __enter__(self) -> Self:
        self._future = self._pool.submit(self._work, self._tell)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._pool.shutdown()

    def _tell(self, part: float) -> None:
        if self._stop.is_set():
            raise _StoppedError
        self._part = part

    def result(self, progress: Callable[[float], None]) -> T:
        """What came of it, as soon as it is there; the caller is told how far it is, and what it raises is raised."""
        while not wait([self._future], _TELL_S).done:
            progress(self._part)
        return self._future.result()
