"""``axiswatch excite``: plans a motion for the identification of an axis, with its predicted accuracy."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer
from rich.console import Console

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import AxisName, ConfigPath, axis_of, names_in
from service.commands.command_line.output_files import write
from service.commands.commissioning.axis.planned_motion import MotionRequest, angle_columns, planned, torque_columns
from service.reports.excitation_report import as_csv, print_text

Output = Annotated[Path, typer.Option("--output", "-o", metavar="FILE.csv", help="File for the motion.")]
Seconds = Annotated[float, typer.Option("--seconds", metavar="S", help="Length of a period.")]
Periods = Annotated[int, typer.Option("--periods", min=1, help="Number of periods, after one to warm up.")]
Band = Annotated[
    tuple[float, float], typer.Option("--band", metavar="LOW HIGH", help="Lowest and highest frequency [Hz].")
]
Limit = Annotated[float | None, typer.Option(metavar="X", help="Largest absolute value at the motor, in SI units.")]
Find = Annotated[
    str,
    typer.Option("--find", metavar="NAMES", help="Shape the spectrum for these: 1/Ja,fm. Default: a flat one."),
]
Free = Annotated[
    str,
    typer.Option("--free", metavar="NAMES", help="Parameters to estimate. Default: all that can be distinguished."),
]
As = Annotated[
    Literal["torque", "speed", "angle"],
    typer.Option("--as", help="What is given to the axis: torque, or a reference to follow."),
]
Seed = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of the random phases, to plan the same motion again."),
]


def excite(
    config: ConfigPath,
    output: Output,
    axis: AxisName = None,
    seconds: Seconds = 10.0,
    periods: Periods = 2,
    band: Band = (0.0, 30.0),
    torque_limit: Limit = None,
    speed_limit: Limit = None,
    angle_limit: Limit = None,
    find: Find = "",
    free: Free = "",
    as_: As = "torque",
    seed: Seed = None,
) -> None:
    """Plan a motion for identification: a multisine as large as the limits allow, and what it will determine.

    The motion begins and ends at rest: a warm-up, then whole periods. At least one of --torque-limit, --speed-limit and
    --angle-limit is needed. The predicted standard deviations hold for the configured drive and noise.
    """
    found = axis_of(config, axis)
    limits = (torque_limit, speed_limit, angle_limit)
    request = MotionRequest(seconds, periods, band, *limits, names_in(find), names_in(free), as_)
    with explained(ValueError):
        experiment = planned(found, request, np.random.default_rng(seed))
    write(output, as_csv(experiment, torque_columns(found), angle_columns(found)))
    print_text(experiment, found.id, Console(highlight=False))
