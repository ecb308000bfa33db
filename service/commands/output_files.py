"""Output files of commands: nominal values, report, JSON, terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from service.commands.exit_codes import MISTAKE
from service.store.atomic_files import replace_text

if TYPE_CHECKING:
    from service.reports.identification_report import IdentificationReport


class Files(NamedTuple):
    """The file of each result; no ``json``: not requested."""

    nominal: Path
    report: Path
    json: Path | None

    @classmethod
    def chosen(
        cls, folder: Path | None, nominal: Path | None, report: Path | None, json: Path | None
    ) -> Files:
        """Nominal values in the folder, the report next to them, unless other paths are given."""
        nominal = nominal or (folder or Path()) / "nominal.toml"
        return cls(nominal, report or (folder or nominal.parent) / "report.html", json)

    def check(self, force: bool, what: str = "nominal values") -> None:
        """Check that the files can be written, before anything is computed; ``what`` is written to the first of them.

        Raises:
            typer.BadParameter: a file exists already, or a folder does not.
        """
        if self.nominal.exists() and not force:
            raise typer.BadParameter(
                f"{self.nominal} is there already; --force overwrites it", param_hint="--output"
            )
        paths = [path for path in self if path is not None and path != STDOUT]
        for path in paths:
            if not path.parent.is_dir() or path.is_dir():
                raise typer.BadParameter(
                    f"{path} cannot be written: {path.parent} is no folder"
                    if not path.is_dir()
                    else f"{path} is a folder"
                )
        if len({path.resolve() for path in paths}) < len(paths):
            raise typer.BadParameter(f"{what}, report and JSON need files of their own")

    def write(self, report: IdentificationReport) -> None:
        """Write all files, the nominal values only if they are reliable; and the tables to the terminal.

        Raises:
            typer.Exit: a file cannot be written.
        """
        texts = list(self._texts(report))  # all before the first is written
        for path, text in texts:
            write(path, text)
        if self.json != STDOUT:
            from rich.console import Console

            from service.reports.identification_text import print_text

            print_text(report, Console(highlight=False))
        written = ", ".join(str(path) for path, _ in texts if path != STDOUT)
        print(f"written: {written}", file=sys.stderr)

    def _texts(self, report: IdentificationReport) -> Iterator[tuple[Path, str]]:
        if not report.rejection:
            from service.reports.identification_toml import as_toml

            yield self.nominal, as_toml(report)
        from service.reports.identification_html import as_html

        yield self.report, as_html(report)
        if self.json is not None:
            from service.reports.identification_json import as_json

            yield self.json, as_json(report)


# --- Results of a command into files ----------------------------------------------------------------------------------


STDOUT = Path("-")


def write(path: Path, text: str) -> None:
    """Write a file atomically: a reader never sees a part of it.

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
    """The .html file of ``where``: itself, or ``name`` in a folder, which is created if needed.

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
