"""The --config option of all commands, and what they do with a file that is wrong."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from service.config import Config, ConfigErrors, Problem, load

ConfigPath = Annotated[
    Path, typer.Option("--config", "-c", help="Configuration file (TOML).", show_default=True, metavar="FILE")
]

_NO_BUS = (
    "no bus: such a configuration is for `identify`, `excite` and `model`; add [[bus]] with its DBC and, to each axis,"
    " bus, and message and signal of torque and motion"
)

CANNOT_RUN = 2
"""Exit status where a command cannot do anything: the configuration is wrong."""


def configuration(path: Path, without_bus: bool = False, thresholds: bool = True) -> Config:
    """The configuration of a file and the environment.

    Args:
        path: the file.
        without_bus: the command needs no bus.
        thresholds: use the files of thresholds that it names.

    Raises:
        typer.Exit: with status 2, after all problems have been written to the error stream.
    """
    try:
        found = load(path, thresholds=thresholds)
        if not found.bus and not without_bus:
            typer.echo(f"axiswatch: {path}: {_NO_BUS}", err=True)
            raise typer.Exit(CANNOT_RUN)
        return found
    except ConfigErrors as errors:
        console = Console(stderr=True, soft_wrap=True, highlight=False)
        for problem in errors.problems:
            console.print(_line(problem))
        count = len(errors.problems)
        console.print(f"{count} problem{'s' if count > 1 else ''} in the configuration", style="bold red")
        raise typer.Exit(CANNOT_RUN) from None


def _line(problem: Problem) -> Text:
    """``file:line: key = value: message`` with the place and the key set apart by colour."""
    text = Text(str(problem))
    text.stylize("cyan", 0, len(problem.place))
    if problem.key:
        start = len(problem.place) + 2
        text.stylize("bold", start, start + len(problem.key))
    return text
