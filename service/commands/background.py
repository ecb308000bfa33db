"""A task in a thread of its own, while the caller continues: the kernel releases the GIL."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import Generic, Self, TypeVar

T = TypeVar("T")
_POLL_S = 0.2


class _CancelledError(Exception):
    """The caller has cancelled the task."""


class Background(Generic[T]):
    """Starts with the ``with`` block and ends with it at the latest; it is cancelled if the block fails.

    Args:
        work: the task; it receives a function for its progress, 0 to 1, which raises when the task is cancelled.
    """

    def __init__(self, work: Callable[[Callable[[float], None]], T]) -> None:
        self._work, self._part, self._stop = work, 0.0, threading.Event()
        self._pool = ThreadPoolExecutor(1)

    def __enter__(self) -> Self:
        self._future = self._pool.submit(self._work, self._report)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._pool.shutdown()

    def _report(self, part: float) -> None:
        if self._stop.is_set():
            raise _CancelledError
        self._part = part

    def __call__(self, progress: Callable[[float], None]) -> T:
        """Wait for the result, reporting the progress meanwhile; an exception of the task is raised here."""
        while not wait([self._future], _POLL_S).done:
            progress(self._part)
        return self._future.result()
