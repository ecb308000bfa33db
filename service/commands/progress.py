"""Progress bars on the error stream, if that is a terminal."""

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
    """A bar; the yielded function sets the completed share, 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(name, total=1.0)
        yield lambda done: progress.update(task, completed=done)


@contextmanager
def steps_bar(name: str) -> Iterator[Callable[[str, float, float], None]]:
    """A bar with a description; the yielded function takes the step's name, the work done and the total work."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(name)

        def update(step: str, done: float, total: float) -> None:
            progress.update(task, completed=done, total=total, description=f"{name}: {step}")

        yield update
