"""``axiswatch model``: the minimal state space of a drive: states, A, B, C, poles, identifiability."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from service.commands.configuration import OptionalValueCommand
from service.commands.drive_choice import FoundDrive, Quantity, experiment_of, found_drive
from service.commands.exit_codes import MISTAKE, explained
from service.config.base_table import SUFFIX
from service.config.drive_sources import LIBRARY

if TYPE_CHECKING:
    from monitor_core.excitation import TorqueExperiment


class Command(OptionalValueCommand):
    """--json alone writes to standard output; a drive after it is the drive."""

    options = ("--json",)

    @staticmethod
    def is_value(word: str) -> bool:
        """Whether the word after the option is a file to write to."""
        return word == "-" or Path(word).suffix not in ("", SUFFIX) or word.startswith("/dev/")


STDOUT = Path("-")

DriveArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="FILE.mo|NAME", help=f"A Modelica file, or a drive of the library: {', '.join(LIBRARY)}."
    ),
]
ModelName = Annotated[
    str | None,
    typer.Option("--model", metavar="NAME", help="Which model of the Modelica file, if there are several."),
]
ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", metavar="FILE", help="The drive of an axis of this configuration instead."
    ),
]
AxisOption = Annotated[
    str | None,
    typer.Option("--axis", metavar="AXIS", help="Which axis, if there are several; its name, or robot.axis."),
]
OutputOption = Annotated[
    Quantity | None,
    typer.Option("--output", help="Measured quantity, overriding the drawing or the configuration."),
]
Latex = Annotated[bool, typer.Option("--latex", help="Print A, B, C as LaTeX instead.")]
Json = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="[FILE]", help="Also write everything here; - or nothing is standard output."
    ),
]
Matlab = Annotated[
    Path | None, typer.Option("--matlab", metavar="FILE.m", help="Also write a function for MATLAB's idgrey.")
]

Record = Annotated[
    Path | None,
    typer.Option(
        "--record",
        metavar="RECORD",
        help="Use the torque of this record instead of a multisine; with --config.",
    ),
]
Wanted = tuple["TorqueExperiment | None", float]


def model(
    drive: DriveArgument = None,
    name: ModelName = None,
    config: ConfigOption = None,
    axis: AxisOption = None,
    output: OutputOption = None,
    latex: Latex = False,
    json: Json = None,
    matlab: Matlab = None,
    record: Record = None,
) -> None:
    """Derive the minimal state space x' = A x + B u, y = C x of a drive, in symbols.

    Shows states, parameters, A, B, C, poles and resonances at nominal values, and which parameters the sensors can
    distinguish, in principle and from a record. A report on standard output replaces the text.
    """
    files = _Files(STDOUT if latex else None, json, matlab)
    files.check()
    with explained():
        found = found_drive(drive, name, config, axis, output)
        experiment = experiment_of(record, config, axis)
        texts = list(files.texts(found, experiment))
    for path, text in texts:
        _write(path, text)
    if STDOUT not in (path for path, _ in texts):
        _print(found, experiment)


class _Files(NamedTuple):
    """Path of each report; None: not requested."""

    latex: Path | None
    json: Path | None
    matlab: Path | None

    def check(self) -> None:
        """Check the paths before anything is computed.

        Raises:
            typer.BadParameter: two reports on standard output, a drawing to be overwritten, an invalid MATLAB name.
        """
        given = {f"--{option}": path for option, path in self._asdict().items() if path is not None}
        shown = [option for option, path in given.items() if path == STDOUT]
        if len(shown) > 1:
            raise typer.BadParameter(f"{' and '.join(shown)} cannot both write to standard output")
        for option, path in given.items():
            if path.suffix == SUFFIX:
                raise typer.BadParameter(
                    f"{path} is a drawing, it will not be overwritten", param_hint=option
                )
        if self.matlab is not None:
            _function_name(self.matlab)

    def texts(self, drive: FoundDrive, experiment: Wanted) -> Iterator[tuple[Path, str]]:
        """Path and text of each requested report."""
        from monitor_core.modeling import nominal_of

        space, nominal = drive.space, nominal_of(drive.space, drive.values)
        if self.json is not None:
            from service.reports.model_facts import facts_of
            from service.reports.model_json import as_json

            yield self.json, as_json(facts_of(space, drive.values, *experiment))
        if self.latex is not None:
            from monitor_core.modeling.symbolic import as_latex

            yield self.latex, as_latex(space)
        if self.matlab is not None:
            from service.reports.model_matlab import as_matlab

            yield self.matlab, as_matlab(space, nominal, _function_name(self.matlab))


def _function_name(path: Path) -> str:
    """MATLAB finds a function by the name of its file.

    Raises:
        typer.BadParameter: it cannot be one.
    """
    from service.reports.model_matlab import is_function_name, matlab_names

    name = "drive" if path == STDOUT else path.stem
    if not is_function_name(name) or (path != STDOUT and path.suffix != ".m"):
        raise typer.BadParameter(
            f"{path.name}: MATLAB finds a function by its file, so call it {matlab_names([name])[name]}.m",
            param_hint="--matlab",
        )
    return name


def _print(drive: FoundDrive, experiment: Wanted) -> None:
    from rich.console import Console

    from service.reports.model_facts import facts_of
    from service.reports.model_text import print_text

    with explained():
        print_text(facts_of(drive.space, drive.values, *experiment), Console(highlight=False))


def _write(path: Path, text: str) -> None:
    if path == STDOUT:
        sys.stdout.write(text)
        return
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        typer.echo(f"axiswatch: cannot write {path}: {error.strerror}", err=True)
        raise typer.Exit(MISTAKE) from None
