"""``axiswatch excite``: plans a motion for the identification of an axis, with its predicted accuracy."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.drive_choice import axis_of
from service.commands.exit_codes import MISTAKE, explained

if TYPE_CHECKING:
    from monitor_core.excitation import Controller, Experiment
    from service.config import NamedAxis


class Given(StrEnum):
    """The command to the axis."""

    TORQUE = "torque"
    SPEED = "speed"
    ANGLE = "angle"


class Grid(StrEnum):
    """Lines of the grid."""

    ALL = "all"
    ODD = "odd"


ConfigOption = Annotated[
    Path,
    typer.Option("--config", "-c", metavar="FILE", help="Configuration file (TOML).", show_default=False),
]
AxisOption = Annotated[
    str | None,
    typer.Option("--axis", metavar="AXIS", help="Which axis, if there are several; its name, or robot.axis."),
]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE.csv", help="Where to write it.", show_default=False)
]
Seconds = Annotated[float, typer.Option("--seconds", metavar="S", help="Length of a period.")]
Periods = Annotated[int, typer.Option("--periods", min=1, help="After one to warm up.")]
Band = Annotated[str, typer.Option("--band", metavar="LOW:HIGH", help="Frequencies [Hz].")]
LinesOption = Annotated[Grid, typer.Option("--lines", help="Odd lines bear friction better.")]
Limit = Annotated[float | None, typer.Option(metavar="X", help="Largest absolute value, SI, at the motor.")]
Find = Annotated[
    str,
    typer.Option(
        "--find", metavar="NAMES", help="The best spectrum for these: 1/Ja,fm. Default: a flat one."
    ),
]
Free = Annotated[
    str,
    typer.Option(
        "--free", metavar="NAMES", help="Parameters to estimate. Default: all that can be distinguished."
    ),
]
As = Annotated[
    Given, typer.Option("--as", help="What is given to the axis: torque, or a reference to follow.")
]
Gain = Annotated[
    float | None,
    typer.Option(metavar="K", help="Of its controller [N m/rad, N m s/rad]. Default: one that follows well."),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Repeat the same phases.")]
Picture = Annotated[Path | None, typer.Option(metavar="FILE", help="Also draw a picture.")]


def excite(
    config: ConfigOption,
    output: Output,
    axis: AxisOption = None,
    seconds: Seconds = 10.0,
    periods: Periods = 2,
    band: Band = "0:30",
    lines: LinesOption = Grid.ODD,
    torque_limit: Limit = None,
    speed_limit: Limit = None,
    angle_limit: Limit = None,
    find: Find = "",
    free: Free = "",
    as_: As = Given.TORQUE,
    kp: Gain = None,
    kd: Gain = None,
    seed: Seed = None,
    svg: Picture = None,
    png: Picture = None,
) -> None:
    """Plan a motion for identification: a multisine as large as the limits allow, and what it will tell.

    From rest and back to it: a warm-up, then whole periods. At least one of --torque-limit, --speed-limit and
    --angle-limit is needed. The predicted standard deviations hold for the configured drive and noise.
    """
    if output in (svg, png) or (svg is not None and svg == png):
        raise typer.BadParameter("two of the files to be written are the same", param_hint="--output")
    found = axis_of(config, axis)
    names = tuple(_names(text) for text in (free, find))
    limits = torque_limit, speed_limit, angle_limit
    with explained():
        experiment = _planned(
            found, seconds, periods, _band(band), lines, as_, names, limits, _controller(kp, kd), seed
        )
    _write_all(experiment, found.id, output, {"svg": svg, "png": png})


def _planned(
    axis: NamedAxis,
    seconds: float,
    periods: int,
    band: tuple[float, float],
    lines: Grid,
    as_: Given,
    names: tuple[tuple[str, ...], ...],
    limits: tuple[float | None, ...],
    controller: Controller | None,
    seed: int | None,
) -> Experiment:
    from monitor_core.excitation import Limits
    from service.commands.experiment import Asked, planned, task_for

    try:
        within = Limits(*(math.inf if limit is None else limit for limit in limits))
        free, find = names
        asked = Asked(axis, seconds, periods, band, lines.value, as_.value, free, find)
        return planned(task_for(asked, within, controller), seed)
    except ValueError as error:
        raise _mistake(str(error)) from None


def _write_all(experiment: Experiment, axis: str, output: Path, pictures: dict[str, Path | None]) -> None:
    """The table, the pictures, then what there is to say."""
    from rich.console import Console

    from service.reports.excitation_text import as_csv, print_text

    _write(output, "".join(as_csv(experiment)).encode())
    for form, path in pictures.items():
        if path is not None:
            from service.reports.excitation_picture import as_picture

            _write(path, as_picture(experiment, f"Experiment for {axis}", form))
    print_text(experiment, axis, Console(highlight=False))


def _band(text: str) -> tuple[float, float]:
    """LOW:HIGH.

    Raises:
        typer.BadParameter: it is no such text.
    """
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise typer.BadParameter(f"{text}: write LOW:HIGH in Hz, as 0:30", param_hint="--band") from None
    return low, high


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _controller(kp: float | None, kd: float | None) -> Controller | None:
    """None where neither is given.

    Raises:
        typer.BadParameter: one is given without the other.
    """
    if kp is None and kd is None:
        return None
    if kp is None or kd is None:
        raise typer.BadParameter("--kp and --kd go together", param_hint="--kp")
    from monitor_core.excitation import Controller

    return Controller(kp, kd)


def _write(path: Path, content: bytes) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:
        raise _mistake(f"cannot write {path}: {error.strerror}") from None


def _mistake(text: str) -> typer.Exit:
    typer.echo(f"axiswatch: {text}", err=True)
    return typer.Exit(MISTAKE)
