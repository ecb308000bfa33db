"""The --config option of all commands, and the report of a wrong file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer
from rich.console import Console
from rich.text import Text
from typer.core import TyperCommand

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


# --- Options whose value may be left out: --json alone is --json -, standard output -----------------------------------


class OptionalValueCommand(TyperCommand):
    """A command that inserts "-" where the value of an option was left out, before the line is parsed."""

    options: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after such an option is its value."""
        return word == "-" or not word.startswith("-")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As typer does it."""
        return super().parse_args(ctx, list(self._completed(args)))

    def _completed(self, args: list[str]) -> Iterator[str]:
        for position, word in enumerate(args):
            yield word
            following = args[position + 1 : position + 2]
            if word in self.options and not (following and self.is_value(following[0])):
                yield "-"
