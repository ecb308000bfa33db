"""Which drive a command line means: a Modelica file, a drive of the library, or that of a configured axis."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from service.config.drive_sources import (
    LIBRARY,
    SUFFIX,
    model_of_axis,
    state_space_of_file,
    state_space_of_library,
)

if TYPE_CHECKING:
    from monitor_core.drive.structure import Output
    from monitor_core.modeling.statespace import StateSpace
    from service.config import NamedAxis


class Quantity(StrEnum):
    """What a sensor measures."""

    SPEED = "speed"
    ANGLE = "angle"

    def drawn(self) -> Output:
        """As the modelling calls it."""
        return "speed" if self is Quantity.SPEED else "angle"


class FoundDrive(NamedTuple):
    """A state space, and nominal values that go before the drawing's own."""

    space: StateSpace
    values: Mapping[str, float]


def found_drive(
    drive: str | None, name: str | None, config: Path | None, axis: str | None, output: Quantity | None
) -> FoundDrive:
    """The one drive that the command line names.

    Raises:
        typer.BadParameter: none or two, or an option that does not go with it.
        ModelError: it is not there, or is no drive.
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
    if drive.endswith(SUFFIX):
        return FoundDrive(state_space_of_file(Path(drive), name, measured), {})
    return FoundDrive(state_space_of_library(drive, measured), {})


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
