"""Progress on the error stream, with bars on a terminal; and a task in a thread that reports its progress."""

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
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
SOON_S = 1.0
"""Shorter tasks show nothing [s]"""


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


def announced(what: str, work: Callable[[], T]) -> T:
    """The result of work that is usually short; if it takes longer, a message says what is being done."""
    with ThreadPoolExecutor(1) as pool:
        task = pool.submit(work)
        if not wait([task], SOON_S).done:
            print(f"{what} ...", file=sys.stderr, flush=True)
            with steps_bar(what):
                wait([task])
    return task.result()


class AxesBars:
    """A bar for each axis in progress; without a terminal a line whenever an axis enters a phase."""

    def __init__(self, progress: Progress, axis_ids: Sequence[str]) -> None:
        self._progress = progress
        self._tasks = {axis_id: progress.add_task(f"{axis_id}: waits", total=1.0) for axis_id in axis_ids}
        self._phases: dict[str, str] = {}

    def show(self, axis_id: str, phase: str, work: str, share: float) -> None:
        """Show the progress of an axis: its phase, the present work, and its share, 0 to 1."""
        description = f"{axis_id}: {phase}: {work}"
        self._progress.update(self._tasks[axis_id], completed=share, description=description)
        if self._progress.disable and self._phases.get(axis_id) != phase:
            self._progress.console.print(f"{axis_id}: {phase} ...", markup=False, highlight=False)
        self._phases[axis_id] = phase

    def end(self, axis_id: str) -> None:
        """Remove the bar of an axis that is finished."""
        self._progress.remove_task(self._tasks[axis_id])


@contextmanager
def axes_bars(axis_ids: Sequence[str]) -> Iterator[AxesBars]:
    """Bars for axes that are processed at the same time."""
    with _bar(TaskProgressColumn(), TimeElapsedColumn()) as progress:
        yield AxesBars(progress, axis_ids)


def _bar(*columns: ProgressColumn) -> Progress:
    console = Console(stderr=True)
    shown = (TextColumn("{task.description}"), BarColumn(), *columns)
    return Progress(*shown, console=console, transient=True, disable=not console.is_terminal)


# --- A task while the caller continues: the kernel releases the GIL ---------------------------------------------------


class _CancelledError(Exception):
    """The caller has cancelled the task."""


class Background(Generic[T]):
    """A task that starts with the ``with`` block and ends with it at the latest; it is cancelled if the block fails.

    ``work`` receives a function for its progress, 0 to 1, which raises when the task is cancelled.
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
        """Wait for the result and report the progress; an exception of the task is raised here."""
        while not wait([self._future], _POLL_S).done:
            progress(self._part)
        return self._future.result()
