"""Options that several commands share, and --json, whose file may be left out."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

ConfigPath = Annotated[
    Path, typer.Option("--config", "-c", help="Configuration file (TOML).", show_default=True, metavar="FILE")
]
AxisName = Annotated[
    str | None,
    typer.Option("--axis", metavar="NAME", help="Which axis, if there are several; its name, or robot.axis."),
]
RecordRanges = Annotated[
    list[str],
    typer.Argument(
        metavar="RECORD...",
        help="Tables (.csv .parquet .mat) or CAN logs (.log .asc .blf .trc) of the healthy axis; FILE@10:60 are its"
        " seconds 10 to 60.",
    ),
]
ReportFile = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="The report; default report.html beside them.")
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="[FILE]", help="Also write everything here; - or nothing is standard output."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite files that are there already.")]
Seconds = Annotated[
    float | None,
    typer.Option("--seconds", min=0.0, metavar="N", help="Stop after N seconds. [default: never]"),
]
Port = Annotated[
    int | None,
    typer.Option(
        "--port", min=0, max=65535, help="Port of the page and the API, instead of the configured one."
    ),
]


class JsonCommand(TyperCommand):
    """A command whose --json alone is --json -, standard output."""

    @staticmethod
    def is_file(word: str) -> bool:
        """Whether the word after --json is a file to write to, and not a record."""
        return word == "-" or word.endswith(".json") or word.startswith("/dev/")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer does it, with what was left out."""
        completed = list[str]()
        for word, following in pairwise([*args, ""]):
            completed += [word, "-"] if word == "--json" and not self.is_file(following) else [word]
        return super().parse_args(ctx, completed)


def names_in(text: str) -> tuple[str, ...]:
    """Names separated by commas; those of merged parameters contain blanks."""
    return tuple(name.strip() for name in text.split(",") if name.strip())
