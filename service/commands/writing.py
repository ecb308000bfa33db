"""Results of a command into files."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import typer

from service.commands.exits import MISTAKE
from service.store.atomic_files import replace_text

STDOUT = Path("-")


def write(path: Path, text: str) -> None:
    """All of it or nothing: what reads the file never sees half of it.

    Raises:
        typer.Exit: it cannot be written.
    """
    try:
        if path == STDOUT:
            sys.stdout.write(text)
        elif path.exists() and not path.is_file():  # a device
            path.write_text(text, encoding="utf-8")
        else:
            replace_text(path, text)
    except OSError as error:
        typer.echo(f"axiswatch: cannot write {path}: {error.strerror}", err=True)
        raise typer.Exit(MISTAKE) from None


def page_in(where: Path, name: str) -> Path:
    """The file that ``where`` means: an .html file, or a folder, made if need be, and ``name`` in it.

    Raises:
        typer.Exit: nothing can be written there.
    """
    is_file = where.suffix.lower() in {".html", ".htm"} and not where.is_dir()
    folder, path = (where.parent, where) if is_file else (where, where / name)
    if why_not := _why_not(folder, path, not is_file):
        typer.echo(f"axiswatch: cannot write {path}: {why_not}", err=True)
        raise typer.Exit(MISTAKE)
    return path


def _why_not(folder: Path, path: Path, make: bool) -> str:
    try:
        if make and not folder.exists():
            folder.mkdir()
    except OSError as error:
        return f"no folder {folder}: {error.strerror}"
    if not folder.is_dir():
        return f"{folder} is no folder"
    if path.is_dir():
        return "it is a folder"
    return "" if os.access(path if path.exists() else folder, os.W_OK) else "Permission denied"
