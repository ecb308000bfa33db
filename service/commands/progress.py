"""Progress bars on the error stream, if that is a terminal; and a task in a thread that reports its progress."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from types import TracebackType
from typing import Generic, Self, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

T = TypeVar("T")
_POLL_S = 0.2


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[float], None]]:
    """A bar; the yielded function sets the completed share, 0 to 1."""
    with _bar(TaskProgressColumn(), TimeRemainingColumn()) as progress:
        task = progress.add_task(name, total=1.0)
        yield lambda done: progress.update(task, completed=done)


@contextmanager
def steps_bar(name: str) -> Iterator[Callable[[str, float, float], None]]:
    """A bar with a description; the yielded function takes the step's name, the work done and the total work."""
    with _bar(TimeElapsedColumn()) as progress:
        task = progress.add_task(name)

        def update(step: str, done: float, total: float) -> None:
            progress.update(task, completed=done, total=total, description=f"{name}: {step}")

        yield update


def _bar(*columns: ProgressColumn) -> Progress:
    console = Console(stderr=True)
    shown = (TextColumn("{task.description}"), BarColumn(), *columns)
    return Progress(*shown, console=console, transient=True, disable=not console.is_terminal)


# --- A task while the caller continues: the kernel releases the GIL ---------------------------------------------------


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
