"""A progress bar on the error stream where that is a terminal, nothing elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[float], None]]:
    """A bar that is told how much has been done, 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(name, total=1.0)
        yield lambda done: progress.update(task, completed=done)


@contextmanager
def steps_bar(name: str) -> Iterator[Callable[[str, float, float], None]]:
    """A bar that is told what is going on, in words, how much of it is done, and how much there is at most."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(name)

        def told(words: str, done: float, most: float) -> None:
            progress.update(task, completed=done, total=most, description=f"{name}: {words}")

        yield told
