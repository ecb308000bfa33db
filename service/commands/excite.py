"""``axiswatch excite``: plans a motion for the identification of an axis, with its predicted accuracy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.commands.configuration import axis_of
from service.commands.exit_codes import explained
from service.commands.options import AxisName, ConfigPath, names_in
from service.commands.output_files import write

if TYPE_CHECKING:
    from monitor_core.excitation import Controller, Experiment

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE.csv", help="Where to write it.", show_default=False)
]
Seconds = Annotated[float, typer.Option("--seconds", metavar="S", help="Length of a period.")]
Periods = Annotated[int, typer.Option("--periods", min=1, help="After one to warm up.")]
Band = Annotated[str, typer.Option("--band", metavar="LOW:HIGH", help="Frequencies [Hz].")]
LinesOption = Annotated[
    Literal["all", "odd"], typer.Option("--lines", help="Odd lines bear friction better.")
]
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
    Literal["torque", "speed", "angle"],
    typer.Option("--as", help="What is given to the axis: torque, or a reference to follow."),
]
Gain = Annotated[
    float | None,
    typer.Option(metavar="K", help="Of its controller [N m/rad, N m s/rad]. Default: one that follows well."),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Repeat the same phases.")]
Picture = Annotated[Path | None, typer.Option(metavar="FILE", help="Also draw a picture.")]


def excite(
    config: ConfigPath,
    output: Output,
    axis: AxisName = None,
    seconds: Seconds = 10.0,
    periods: Periods = 2,
    band: Band = "0:30",
    lines: LinesOption = "odd",
    torque_limit: Limit = None,
    speed_limit: Limit = None,
    angle_limit: Limit = None,
    find: Find = "",
    free: Free = "",
    as_: As = "torque",
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
    found, controller, band_hz = axis_of(config, axis), _controller(kp, kd), _band(band)
    with explained(ValueError):
        from monitor_core.excitation import Limits
        from service.commands.experiment import Asked, planned

        limits = (math.inf if limit is None else limit for limit in (torque_limit, speed_limit, angle_limit))
        within = Limits(*limits)
        names = names_in(free), names_in(find)
        asked = Asked(found, seconds, periods, band_hz, lines, as_, *names, within, controller)
        experiment = planned(asked, seed)
    _write_all(experiment, found.id, output, {"svg": svg, "png": png})


def _write_all(experiment: Experiment, axis: str, output: Path, pictures: dict[str, Path | None]) -> None:
    """The table, the pictures, then what there is to say."""
    from rich.console import Console

    from service.reports.excitation_report import as_csv, as_picture, print_text

    write(output, "".join(as_csv(experiment)))
    for form, path in pictures.items():
        if path is not None:
            write(path, as_picture(experiment, f"Experiment for {axis}", form))
    print_text(experiment, axis, Console(highlight=False))


def _band(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise typer.BadParameter(f"{text}: write LOW:HIGH in Hz, as 0:30", param_hint="--band") from None
    return low, high


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
