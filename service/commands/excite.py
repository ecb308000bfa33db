"""``axiswatch excite``: plans a motion for the identification of an axis, with its predicted accuracy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
import typer
from rich.console import Console

from monitor_core.drive import Drive
from monitor_core.excitation import (
    Estimation,
    ExcitationError,
    Experiment,
    Limits,
    Lines,
    Plant,
    Task,
    plan,
)
from monitor_core.wording import did_you_mean
from service.commands.exit_codes import explained
from service.commands.options import AxisName, ConfigPath, axis_of, names_in
from service.commands.output_files import write
from service.config import NamedAxis, drive_of, given_values, predictor_of
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.reports.excitation_report import as_csv, as_picture, print_text

if TYPE_CHECKING:
    from monitor_core.excitation import Command  # at run time main would take it for the class of the command

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
    seed: Seed = None,
    svg: Picture = None,
    png: Picture = None,
) -> None:
    """Plan a motion for identification: a multisine as large as the limits allow, and what it will determine.

    From rest and back to it: a warm-up, then whole periods. At least one of --torque-limit, --speed-limit and
    --angle-limit is needed. The predicted standard deviations hold for the configured drive and noise.
    """
    if output in (svg, png) or (svg is not None and svg == png):
        raise typer.BadParameter("two of the files to be written are the same", param_hint="--output")
    found, band_hz = axis_of(config, axis), _band(band)
    with explained(ValueError):
        limits = (math.inf if limit is None else limit for limit in (torque_limit, speed_limit, angle_limit))
        names = names_in(free), names_in(find)
        asked = Asked(found, seconds, periods, band_hz, lines, as_, *names, Limits(*limits))
        experiment = planned(asked, seed)
    write(output, "".join(as_csv(experiment)))
    for form, path in (("svg", svg), ("png", png)):
        if path is not None:
            write(path, as_picture(experiment, f"Experiment for {found.id}", form))
    print_text(experiment, found.id, Console(highlight=False))


def _band(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise typer.BadParameter(f"{text}: write LOW:HIGH in Hz, as 0:30", param_hint="--band") from None
    return low, high


# --- From a configured axis and the requirements to an experiment -----------------------------------------------------


_LONGEST = 2_000_000


class Asked(NamedTuple):
    """Requirements of the command line."""

    axis: NamedAxis
    seconds: float
    periods: int
    band_hz: tuple[float, float]
    lines: Lines
    command: Command
    free: tuple[str, ...]
    find: tuple[str, ...]
    limits: Limits


def planned(asked: Asked, seed: int | None) -> Experiment:
    """The experiment for an axis with its nominal values and its predictor.

    Raises:
        ExcitationError: it is not possible; the text says what would be right.
        AxisError: the axis has no predictor.
    """
    config = asked.axis.config
    drive, values, h = drive_of(config), given_values(config), config.sample_interval_s
    _check_known(asked.axis, drive)
    model = axis_model(config)
    settings = axis_settings(asked.axis, model)
    measured = drive_of(config, config.output)
    _check_names(asked, measured.complete(values))
    K = np.array(settings.K) if settings.K else None
    if K is not None and model.drive.mean_state >= 0:  # a plan treats a mean speed as the speed at the sample
        K = np.delete(K, model.drive.mean_state)
    task = Task(
        plant=Plant(drive_of(config, "angle"), values, h, settings.speed_scale),
        estimation=Estimation(measured, values, h, settings.lam0, K, config.model.scales),
        limits=asked.limits,
        period=_samples(asked, h),
        periods=asked.periods,
        band_hz=_checked_band(asked, h),
        lines=asked.lines,
        command=asked.command,
        free=asked.free,
        find=asked.find,
    )
    return plan(task, np.random.default_rng(seed))


def _check_known(axis: NamedAxis, drive: Drive) -> None:
    """Check that nominal values and noise are known, which an axis without a bus may lack."""
    values, predictor = given_values(axis.config), predictor_of(axis.config)
    lacking = []
    try:
        drive.complete(values)
    except KeyError:
        lacking = [p.name for p in drive.parameters if p.name not in values]
    if predictor.innovation_variance is None:
        lacking += [name for name in ("torque_noise", "output_noise") if getattr(predictor, name) is None]
    if lacking:
        raise ExcitationError(
            f"{axis.id}: a motion is planned with the drive's values and noises, and the configuration has no"
            f" {', '.join(lacking)}: give a guess, or identify a first record and name its nominal_file"
        )


def _samples(asked: Asked, interval_s: float) -> int:
    if not (math.isfinite(asked.seconds) and asked.seconds >= 16 * interval_s):
        raise ExcitationError(
            f"a period of {asked.seconds:g} s: need at least 16 samples, {16 * interval_s:g} s"
        )
    samples = round(asked.seconds / interval_s)
    if samples * (asked.periods + 2) > _LONGEST:
        raise ExcitationError(
            f"{asked.periods} periods of {asked.seconds:g} s have more than {_LONGEST} samples: ask for less"
        )
    return samples


def _checked_band(asked: Asked, interval_s: float) -> tuple[float, float]:
    low, high = asked.band_hz
    if not (0 <= low < high < math.inf):
        raise ExcitationError(f"band {low:g}:{high:g}: need 0 <= low < high, in Hz")
    if high >= 0.5 / interval_s:
        raise ExcitationError(
            f"band {low:g}:{high:g}: {1 / interval_s:g} samples a second reach to below {0.5 / interval_s:g} Hz"
        )
    return low, high


def _check_names(asked: Asked, values: dict[str, float]) -> None:
    for names in (asked.free, asked.find):
        bases = [name.removeprefix("1/").strip() for name in names]
        for name, base in zip(names, bases, strict=True):
            if base not in values:
                raise ExcitationError(f"no parameter {name!r}: {did_you_mean(base, values)}")
            if values[base] == 0 and name not in asked.axis.config.model.scales:
                raise ExcitationError(
                    f"{name} is 0: give its size in [robot.axis.model.scales], or do not ask for it"
                )
        if len(set(bases)) < len(bases):
            raise ExcitationError(f"a parameter is named twice: {', '.join(names)}")
