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

from service.commands.command_line.exit_codes import MISTAKE

STDOUT = Path("-")
_WIDE = 160
"""Line width without a terminal; at 80 characters the numbers of a table would be broken."""


class ResultFiles(NamedTuple):
    """The output file of each result; ``json`` is None if not requested."""

    values: Path
    report: Path
    json: Path | None

    @classmethod
    def chosen(cls, values: Path, report: Path | None, json: Path | None) -> ResultFiles:
        """Output files with the report beside the values, unless another path is given."""
        return cls(values, report or values.parent / "report.html", json)

    def check(self, force: bool, what: str) -> None:
        """Check that the files can be written; ``what``: name of the contents of the first one.

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
    """The console for tables of results."""
    return Console(highlight=False, width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else _WIDE)


def check_new(path: Path, force: bool) -> None:
    """Check that a file can be written and does not exist yet, unless ``force`` is set.

    Raises:
        typer.BadParameter: it cannot be written, or exists.
    """
    check_writable(path)
    if path.exists() and not force:
        raise typer.BadParameter(f"{path} is there already; --force overwrites it", param_hint="--output")


def check_writable(path: Path) -> None:
    """Check that a file can be written, before anything is computed.

    Raises:
        typer.BadParameter: it is a folder, its folder does not exist, or the rights are missing.
    """
    if path.is_dir():
        raise typer.BadParameter(f"{path} is a folder")
    if not path.parent.is_dir():
        raise typer.BadParameter(f"{path} cannot be written: {path.parent} is no folder")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise typer.BadParameter(f"{path} cannot be written: Permission denied")


def write_all(texts: Sequence[tuple[Path, str]]) -> None:
    """Write files, and print their names on the error stream."""
    for path, text in texts:
        write(path, text)
    written = ", ".join(str(path) for path, _ in texts if path != STDOUT)
    print(f"written: {written}", file=sys.stderr)


def write(path: Path, content: str | bytes) -> None:
    """Write a file; text is written atomically, so that a reader never sees a part of it."""
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
