"""The drive of a command line: a Modelica file, a drive of the library, or that of a configured axis."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from service.config.base_table import SUFFIX
from service.config.drive_sources import LIBRARY, model_called, model_of_axis

if TYPE_CHECKING:
    from monitor_core.drive import Output
    from monitor_core.excitation import TorqueExperiment
    from monitor_core.modeling import StateSpace
    from service.config import AxisConfig, NamedAxis


class Quantity(StrEnum):
    """Measured quantity of a sensor."""

    SPEED = "speed"
    ANGLE = "angle"

    def drawn(self) -> Output:
        """The quantity under its name in the modelling package."""
        return "speed" if self is Quantity.SPEED else "angle"


class FoundDrive(NamedTuple):
    """A state space, and nominal values that take precedence over the drawing's own."""

    space: StateSpace
    values: Mapping[str, float]


def found_drive(
    drive: str | None, name: str | None, config: Path | None, axis: str | None, output: Quantity | None
) -> FoundDrive:
    """The drive that the command line names.

    Raises:
        typer.BadParameter: none or two, or an option that does not fit.
        ModelError: it does not exist, or is no drive.
    """
    if (drive is None) == (config is None):
        known = f"a file ({SUFFIX}), one of {', '.join(LIBRARY)}, or --config FILE"
        raise typer.BadParameter(f"give {'a drive' if drive is None else 'one drive, not two'}: {known}")
    if axis is not None and config is None:
        raise typer.BadParameter("goes with --config FILE", param_hint="--axis")
    if name is not None and not (drive or "").endswith(SUFFIX):
        raise typer.BadParameter(f"goes with a Modelica file (FILE{SUFFIX})", param_hint="--model")
    measured = None if output is None else output.drawn()
    if config is not None:
        return _of_axis(config, axis, measured)
    assert drive is not None
    return FoundDrive(model_called(drive, name, measured).space, {})


def _of_axis(config: Path, axis: str | None, measured: Output | None) -> FoundDrive:
    from service.config import given_values

    found = axis_of(config, axis)
    modelled = model_of_axis(found.config, measured)
    return FoundDrive(modelled.space, given_values(found.config))


def axis_of(config: Path, wanted: str | None) -> NamedAxis:
    """The one axis of a configuration that is wanted: by its name, or the only one.

    Raises:
        typer.BadParameter: there is none, or several.
    """
    from service.commands.configuration import configuration

    return axis_named(configuration(config, without_bus=True).axes, wanted)


def axis_named(axes: tuple[NamedAxis, ...], wanted: str | None) -> NamedAxis:
    """The one of these axes that is wanted: by its name, or the only one.

    Raises:
        typer.BadParameter: there is none, or several.
    """
    names = ", ".join(a.id for a in axes)
    if wanted is None and len(axes) > 1:
        raise typer.BadParameter(f"say which axis: there is {names}", param_hint="--axis")
    found = [a for a in axes if wanted in (None, a.id, a.id.split(".", 1)[1])]
    if len(found) != 1:
        what = "is in more than one robot" if found else "is not there"
        raise typer.BadParameter(f"{wanted} {what}; there is {names}", param_hint="--axis")
    return found[0]


# --- Which torque a command asks about: that of a record, through the configuration of an axis ------------------------


LONGEST = 20_000
"""Samples of a record that are looked at: more tell the same, only more exactly."""


def experiment_of(
    record: Path | None, config: Path | None, axis: str | None
) -> tuple[TorqueExperiment | None, float]:
    """The experiment of a record, None without one, and the speed scale of Coulomb friction.

    Raises:
        typer.BadParameter: a record without the configuration that says how to read it.
        RecordError: it cannot be read, or has fewer than two samples of the axis.
    """
    if config is None:
        if record is not None:
            raise typer.BadParameter(
                "goes with --config FILE, which says how to read it", param_hint="--record"
            )
        return None, 1.0
    from service.config import predictor_of

    found = axis_of(config, axis)
    speed_scale = predictor_of(found.config).friction_speed_scale
    return None if record is None else _read(record, config, found.id, found.config), speed_scale


def _read(path: Path, config: Path, axis_id: str, axis: AxisConfig) -> TorqueExperiment:
    from monitor_core.excitation import TorqueExperiment
    from service.can.user_errors import RecordError
    from service.commands.configuration import configuration
    from service.config import predictor_of
    from service.ingest.records import read_record, samples_of

    record = read_record(path, configuration(config, without_bus=True))
    torque = samples_of(record, axis_id).u[:LONGEST]
    if len(torque) < 2:
        raise RecordError(f"{path}: no samples of {axis_id}")
    seconds = len(torque) * axis.sample_interval_s
    words = f"the torque of {path.name}, {seconds:.3g} s at {1 / axis.sample_interval_s:.4g} samples a second"
    return TorqueExperiment(torque, axis.sample_interval_s, words, predictor_of(axis).output_noise)
