"""``axiswatch excite``: plans a motion for the identification of an axis, with its predicted accuracy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer
from rich.console import Console

from monitor_core.excitation import (
    Estimation,
    ExcitationError,
    Limits,
    Plant,
    Task,
    plan,
)
from monitor_core.wording import did_you_mean
from service.commands.exit_codes import explained
from service.commands.options import AxisName, ConfigPath, axis_of, names_in
from service.commands.output_files import write
from service.config import NamedAxis, drive_of, given_values
from service.config.axis_settings import axis_settings, unknown_of
from service.config.drives import axis_model
from service.reports.excitation_report import as_csv, as_picture, print_text

Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE.csv", help="Where to write it.", show_default=False)
]
Seconds = Annotated[float, typer.Option("--seconds", metavar="S", help="Length of a period.")]
Periods = Annotated[int, typer.Option("--periods", min=1, help="After one to warm up.")]
Band = Annotated[tuple[float, float], typer.Option("--band", metavar="LOW HIGH", help="Frequencies [Hz].")]
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
Picture = Annotated[
    Path | None, typer.Option("--picture", metavar="FILE.svg|.png", help="Also draw a picture.")
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
    picture: Picture = None,
) -> None:
    """Plan a motion for identification: a multisine as large as the limits allow, and what it will determine.

    From rest and back to it: a warm-up, then whole periods. At least one of --torque-limit, --speed-limit and
    --angle-limit is needed. The predicted standard deviations hold for the configured drive and noise.
    """
    if picture is not None and picture.suffix not in _FORMS:
        raise typer.BadParameter(f"{picture}: must end with .svg or .png", param_hint="--picture")
    found = axis_of(config, axis)
    h = found.config.sample_interval_s
    with explained(ValueError):
        plant, estimation = _plant_and_estimation(found)
        limits = (math.inf if limit is None else limit for limit in (torque_limit, speed_limit, angle_limit))
        task = Task(
            plant,
            estimation,
            Limits(*limits),
            period=_samples(seconds, periods, h),
            periods=periods,
            band_hz=_checked_band(band, h),
            command=as_,
            free=names_in(free),
            find=names_in(find),
        )
        for names in (task.free, task.find):
            _check_names(names, estimation)
        experiment = plan(task, np.random.default_rng(seed))
    write(output, as_csv(experiment))
    if picture is not None:
        form = picture.suffix.removeprefix(".")
        write(picture, as_picture(experiment, f"Experiment for {found.id}", form))
    print_text(experiment, found.id, Console(highlight=False))


# --- From a configured axis and the options to an experiment ----------------------------------------------------------


_LONGEST = 2_000_000
_FORMS = (".svg", ".png")


def _plant_and_estimation(axis: NamedAxis) -> tuple[Plant, Estimation]:
    """The drive of an axis with its nominal values, and how its parameters will be estimated.

    Raises:
        ExcitationError: a nominal value or a noise is not known.
        AxisError: the axis has no predictor.
    """
    config = axis.config
    values, h = given_values(config), config.sample_interval_s
    _check_known(axis)
    model = axis_model(config)
    settings = axis_settings(axis, model)
    K = np.array(settings.K) if settings.K else None
    if K is not None and model.drive.mean_state >= 0:  # a plan treats a mean speed as the speed at the sample
        K = np.delete(K, model.drive.mean_state)
    plant = Plant(drive_of(config, "angle"), values, h, settings.speed_scale)
    measured = drive_of(config, config.output)
    return plant, Estimation(measured, values, h, settings.lam0, K, config.model.scales)


def _check_known(axis: NamedAxis) -> None:
    """Check that nominal values and noise are known, which an axis without a bus may lack."""
    if missing := unknown_of(axis.config):
        raise ExcitationError(
            f"{axis.id}: a motion is planned with the drive's values and noises, and the configuration has no"
            f" {', '.join(missing)}: give a guess, or identify a first record and name its nominal_file"
        )


def _samples(seconds: float, periods: int, interval_s: float) -> int:
    """Samples in a period."""
    if not (math.isfinite(seconds) and seconds >= 16 * interval_s):
        raise ExcitationError(f"a period of {seconds:g} s: need at least 16 samples, {16 * interval_s:g} s")
    samples = round(seconds / interval_s)
    if samples * (periods + 2) > _LONGEST:
        raise ExcitationError(
            f"{periods} periods of {seconds:g} s have more than {_LONGEST} samples: ask for less"
        )
    return samples


def _checked_band(band_hz: tuple[float, float], interval_s: float) -> tuple[float, float]:
    (low, high), most = band_hz, 0.5 / interval_s
    if not 0 <= low < high < most:
        raise ExcitationError(
            f"band {low:g} {high:g}: need 0 <= low < high < {most:g} Hz, half the samples a second"
        )
    return band_hz


def _check_names(names: Sequence[str], estimation: Estimation) -> None:
    values = estimation.values
    bases = [name.removeprefix("1/").strip() for name in names]
    for name, base in zip(names, bases, strict=True):
        if base not in values:
            raise ExcitationError(f"no parameter {name!r}: {did_you_mean(base, values)}")
        if values[base] == 0 and name not in estimation.scales:
            raise ExcitationError(
                f"{name} is 0: give its size in [robot.axis.model.scales], or do not ask for it"
            )
    if len(set(bases)) < len(bases):
        raise ExcitationError(f"a parameter is named twice: {', '.join(names)}")
