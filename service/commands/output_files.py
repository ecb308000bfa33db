"""Output files of commands: written atomically, and checked before anything is computed.

A file that cannot be written ends the command, with status 2 and a message.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import typer
from rich.console import Console

from service.commands.exit_codes import MISTAKE

STDOUT = Path("-")
_WIDE = 160
"""Characters of a line where the output is no terminal: in 80 the numbers of a table are broken."""


class Files(NamedTuple):
    """The file of each result; no ``json``: not requested."""

    values: Path
    report: Path
    json: Path | None

    @classmethod
    def chosen(cls, values: Path, report: Path | None, json: Path | None) -> Files:
        """The report next to the values, unless another path is given."""
        return cls(values, report or values.parent / "report.html", json)

    def check(self, force: bool, what: str) -> None:
        """Check that the files can be written; ``what`` is written to the first of them.

        Raises:
            typer.BadParameter: a file exists already, or a folder does not.
        """
        check_new(self.values, force)
        paths = [path for path in self if path is not None and path != STDOUT]
        for path in paths:
            check_writable(path)
        if len({path.resolve() for path in paths}) < len(paths):
            raise typer.BadParameter(f"{what}, report and JSON need files of their own")

    def write(
        self, values: str | None, report: str, as_json: Callable[[], str], show: Callable[[Console], None]
    ) -> None:
        """Write the results, values if there are any; ``show`` prints them unless the JSON is on standard output."""
        texts = [(self.report, report)] if values is None else [(self.values, values), (self.report, report)]
        if self.json is not None:
            texts.append((self.json, as_json()))
        if self.json != STDOUT:
            show(table_console())
        write_all(texts)


def table_console() -> Console:
    """Where the tables of results are printed."""
    return Console(highlight=False, width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else _WIDE)


def check_new(path: Path, force: bool) -> None:
    """Check that a file can be written, and is not there yet, unless that is meant.

    Raises:
        typer.BadParameter: it cannot, or is.
    """
    check_writable(path)
    if path.exists() and not force:
        raise typer.BadParameter(f"{path} is there already; --force overwrites it", param_hint="--output")


def check_writable(path: Path) -> None:
    """Check that a file can be written, before anything is computed.

    Raises:
        typer.BadParameter: it is a folder, or is in none, or must not be written.
    """
    if path.is_dir():
        raise typer.BadParameter(f"{path} is a folder")
    if not path.parent.is_dir():
        raise typer.BadParameter(f"{path} cannot be written: {path.parent} is no folder")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise typer.BadParameter(f"{path} cannot be written: Permission denied")


def write_all(texts: Sequence[tuple[Path, str]]) -> None:
    """Write files, and their names to the error stream."""
    for path, text in texts:
        write(path, text)
    written = ", ".join(str(path) for path, _ in texts if path != STDOUT)
    print(f"written: {written}", file=sys.stderr)


def write(path: Path, content: str | bytes) -> None:
    """Write a file, a text atomically: a reader never sees a part of it."""
    try:
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif path == STDOUT:
            sys.stdout.write(content)
        elif path.exists() and not path.is_file():  # a device
            path.write_text(content, encoding="utf-8")
        else:
            replace_text(path, content)
    except OSError as error:
        typer.echo(f"axiswatch: cannot write {path}: {error.strerror}", err=True)
        raise typer.Exit(MISTAKE) from None


def replace_text(path: Path, text: str) -> None:
    """Write the whole text or nothing: a reader sees the old or the new file, never a part.

    Raises:
        OSError: it cannot be written.
    """
    target = path.resolve()  # of a link, what it points to
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, part)
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
