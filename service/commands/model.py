"""``axiswatch model``: the minimal state space of a drive: states, A, B, C, poles, identifiability."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer
from rich.console import Console

from service.commands.exit_codes import explained
from service.commands.options import AxisName, JsonCommand, JsonFile, axis_named, configuration
from service.commands.output_files import STDOUT, write
from service.config.base_table import SUFFIX
from service.config.drive_sources import LIBRARY, model_called, model_of_axis
from service.reports.model_facts import as_json, facts_of
from service.reports.model_text import print_text

if TYPE_CHECKING:
    from monitor_core.excitation import TorqueExperiment
    from monitor_core.modeling import StateSpace
    from service.config import Config, NamedAxis

LONGEST = 20_000
"""Samples of a record that are looked at: more tell the same, only more exactly."""


class Command(JsonCommand):
    """A drive after --json is the drive."""

    @staticmethod
    def is_file(word: str) -> bool:
        """Whether the word after --json is a file to write to."""
        return word == "-" or Path(word).suffix not in ("", SUFFIX) or word.startswith("/dev/")


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
OutputOption = Annotated[
    Literal["speed", "angle"] | None,
    typer.Option("--output", help="Measured quantity, overriding the drawing or the configuration."),
]
Record = Annotated[
    Path | None,
    typer.Option(
        "--record",
        metavar="RECORD",
        help="Use the torque of this record instead of a multisine; with --config.",
    ),
]


class Drive(NamedTuple):
    """A state space, nominal values that take precedence over the drawing's own, and the torque to tell them from."""

    space: StateSpace
    values: Mapping[str, float]
    experiment: TorqueExperiment | None = None
    speed_scale: float = 1.0
    """Of Coulomb friction [rad/s]"""


def model(
    drive: DriveArgument = None,
    name: ModelName = None,
    config: ConfigOption = None,
    axis: AxisName = None,
    output: OutputOption = None,
    json: JsonFile = None,
    record: Record = None,
) -> None:
    """Derive the minimal state space x' = A x + B u, y = C x of a drive, in symbols.

    Shows states, parameters, A, B, C, poles and resonances at nominal values, and which parameters the sensors can
    distinguish, in principle and from a record. A report on standard output replaces the text.
    """
    _check_output(json)
    _check_source(drive, name, config, axis, record)
    with explained():
        if config is not None:
            found = _drive_of_axis(config, axis, output, record)
        else:
            found = Drive(model_called(drive or "", name, output).space, {})
        facts = facts_of(*found)
        if json is not None:
            write(json, as_json(facts))
        if json != STDOUT:
            print_text(facts, Console(highlight=False))


def _check_output(json: Path | None) -> None:
    if json is not None and json.suffix == SUFFIX:
        raise typer.BadParameter(f"{json} is a drawing, it will not be overwritten", param_hint="--json")


def _check_source(
    drive: str | None, name: str | None, config: Path | None, axis: str | None, record: Path | None
) -> None:
    """Check that the command line names one drive."""
    if (drive is None) == (config is None):
        known = f"a file ({SUFFIX}), one of {', '.join(LIBRARY)}, or --config FILE"
        raise typer.BadParameter(f"give {'a drive' if drive is None else 'one drive, not two'}: {known}")
    if axis is not None and config is None:
        raise typer.BadParameter("goes with --config FILE", param_hint="--axis")
    if name is not None and not (drive or "").endswith(SUFFIX):
        raise typer.BadParameter(f"goes with a Modelica file (FILE{SUFFIX})", param_hint="--model")
    if record is not None and config is None:
        raise typer.BadParameter("goes with --config FILE, which says how to read it", param_hint="--record")


def _drive_of_axis(
    config: Path, axis: str | None, output: Literal["speed", "angle"] | None, record: Path | None
) -> Drive:
    from service.config import given_values, predictor_of

    read = configuration(config, without_bus=True)
    found = axis_named(read.axes, axis)
    experiment = None if record is None else _experiment(record, read, found)
    space = model_of_axis(found.config, output).space
    return Drive(
        space, given_values(found.config), experiment, predictor_of(found.config).friction_speed_scale
    )


def _experiment(path: Path, config: Config, axis: NamedAxis) -> TorqueExperiment:
    from monitor_core.excitation import TorqueExperiment
    from service.can.user_errors import RecordError
    from service.config import predictor_of
    from service.ingest.records import read_record, samples_of

    interval_s = axis.config.sample_interval_s
    torque = samples_of(read_record(path, config), axis.id).u[:LONGEST]
    if len(torque) < 2:
        raise RecordError(f"{path}: no samples of {axis.id}")
    seconds = len(torque) * interval_s
    words = f"the torque of {path.name}, {seconds:.3g} s at {1 / interval_s:.4g} samples a second"
    return TorqueExperiment(torque, interval_s, words, predictor_of(axis.config).output_noise)
