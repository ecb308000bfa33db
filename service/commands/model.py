"""``axiswatch model``: the minimal state space of a drive: states, A, B, C, poles, identifiability."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import AxisName, JsonFile, axis_of
from service.commands.command_line.output_files import STDOUT, table_console, write
from service.config import given_values
from service.config.drive_sources import LIBRARY, model_called, model_of_axis
from service.config.schema.base_table import SUFFIX
from service.reports.model_report import as_json, facts_of, print_text

DriveArgument = Annotated[
    str | None,
    typer.Argument(metavar="FILE.mo|NAME", help=f"A Modelica file, or a drive of the library: {', '.join(LIBRARY)}."),
]
ModelName = Annotated[
    str | None,
    typer.Option("--model", metavar="NAME", help="Which model of the Modelica file, if there are several."),
]
ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", "-c", metavar="FILE", help="The drive of an axis of this configuration instead."),
]
OutputOption = Annotated[
    Literal["speed", "angle"] | None,
    typer.Option("--output", help="Measured quantity, overriding the drawing or the configuration."),
]


def model(
    drive: DriveArgument = None,
    name: ModelName = None,
    config: ConfigOption = None,
    axis: AxisName = None,
    output: OutputOption = None,
    json: JsonFile = None,
) -> None:
    """Derive the minimal state space x' = A x + B u, y = C x of a drive, in symbols.

    Shows states, parameters, A, B, C, poles and resonances at nominal values, and which parameters the sensors can
    distinguish. A report on standard output replaces the text.
    """
    if json is not None and json.suffix == SUFFIX:
        raise typer.BadParameter(f"{json} is a drawing, it will not be overwritten", param_hint="--json")
    _check_source(drive, name, config, axis)
    with explained():
        if config is not None:
            found = axis_of(config, axis).config
            facts = facts_of(model_of_axis(found, output).space, given_values(found))
        else:
            called = model_called(drive or "", name, output)
            facts = facts_of(called.space, called.values)
        if json is not None:
            write(json, as_json(facts))
        if json != STDOUT:
            print_text(facts, table_console())


def _check_source(drive: str | None, name: str | None, config: Path | None, axis: str | None) -> None:
    """Check that the command line names one drive."""
    if (drive is None) == (config is None):
        known = f"a file ({SUFFIX}), one of {', '.join(LIBRARY)}, or --config FILE"
        raise typer.BadParameter(f"give {'a drive' if drive is None else 'one drive, not two'}: {known}")
    if axis is not None and config is None:
        raise typer.BadParameter("goes with --config FILE", param_hint="--axis")
    if name is not None and not (drive or "").endswith(SUFFIX):
        raise typer.BadParameter(f"goes with a Modelica file (FILE{SUFFIX})", param_hint="--model")
