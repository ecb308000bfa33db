"""Where ``axiswatch identify`` writes to: nominal values, report, JSON, terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from service.commands.writing import STDOUT, write

if TYPE_CHECKING:
    from service.reports.identification_report import IdentificationReport


class Files(NamedTuple):
    """Where each result goes; no ``json``: not wanted."""

    nominal: Path
    report: Path
    json: Path | None

    @classmethod
    def of(cls, folder: Path | None, nominal: Path | None, report: Path | None, json: Path | None) -> Files:
        """Nominal values in the folder, the report beside them, unless told otherwise."""
        nominal = nominal or (folder or Path()) / "nominal.toml"
        return cls(nominal, report or (folder or nominal.parent) / "report.html", json)

    def check(self, force: bool, what: str = "nominal values") -> None:
        """That they can be written, before anything is computed; ``what`` is written to the first of them.

        Raises:
            typer.BadParameter: that is there already, or a folder is not.
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
        """All of them, the nominal values only if they can be trusted; and the tables to the terminal.

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
