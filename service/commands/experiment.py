"""From a configured axis and the requirements to an experiment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import Drive
from monitor_core.excitation import (
    Command,
    Controller,
    Estimation,
    ExcitationError,
    Experiment,
    Limits,
    Lines,
    Plant,
    Task,
    plan,
)
from monitor_core.settings import Settings
from monitor_core.wording import did_you_mean
from service.config import NamedAxis, drive_of, given_values, predictor_of
from service.config.axis_settings import axis_model, axis_settings

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


def task_for(asked: Asked, limits: Limits, controller: Controller | None) -> Task:
    """The task for an axis with its nominal values and its predictor.

    Raises:
        ExcitationError: it is not possible; the text says what would be right.
        AxisError: the axis has no predictor.
    """
    config = asked.axis.config
    _check_known(asked.axis)
    model = axis_model(config)
    settings, drive = (
        axis_settings(asked.axis._replace(config=config), model),
        drive_of(config, config.output),
    )
    values, h = given_values(config), config.sample_interval_s
    if controller is not None and asked.command == "torque":
        raise ExcitationError(
            "kp and kd are those of a controller that follows speed or angle: leave them out"
        )
    _check_names(asked, drive.complete(values), dict(config.model.scales))
    return Task(
        plant=Plant(drive_of(config, "angle"), values, h, settings.speed_scale),
        estimation=Estimation(
            drive,
            values,
            h,
            settings.lam0,
            _gain(settings, model.drive),
            config.model.scales,
        ),
        limits=limits,
        period=_samples(asked, h),
        periods=asked.periods,
        band_hz=_band(asked, h),
        lines=asked.lines,
        command=asked.command,
        controller=controller,
        free=asked.free,
        find=asked.find,
    )


def planned(task: Task, seed: int | None) -> Experiment:
    """The experiment.

    Raises:
        ExcitationError: there is none.
    """
    return plan(task, np.random.default_rng(seed))


def _gain(settings: Settings, drive: Drive) -> Floats | None:
    """K without the state of a mean speed: a plan treats it as the speed at the sample."""
    if not settings.K:
        return None
    return (
        np.delete(np.array(settings.K), drive.mean_state) if drive.mean_state >= 0 else np.array(settings.K)
    )


def _check_known(axis: NamedAxis) -> None:
    """Check that nominal values and noise are known, which an axis without a bus may lack."""
    drive, values, predictor = drive_of(axis.config), given_values(axis.config), predictor_of(axis.config)
    lacking = []
    try:
        drive.complete(values)
    except KeyError:
        lacking = [p.name for p in drive.parameters if p.name not in values]
    if predictor.innovation_variance is None:
        noises = {"torque_noise": predictor.torque_noise, "output_noise": predictor.output_noise}
        lacking += [name for name, value in noises.items() if value is None]
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


def _band(asked: Asked, interval_s: float) -> tuple[float, float]:
    low, high = asked.band_hz
    if not (0 <= low < high < math.inf):
        raise ExcitationError(f"band {low:g}:{high:g}: need 0 <= low < high, in Hz")
    if high >= 0.5 / interval_s:
        raise ExcitationError(
            f"band {low:g}:{high:g}: {1 / interval_s:g} samples a second reach to below {0.5 / interval_s:g} Hz"
        )
    return low, high


def _check_names(asked: Asked, values: dict[str, float], scales: dict[str, float]) -> None:
    for name in (*asked.free, *asked.find):
        base = name.removeprefix("1/").strip()
        if base not in values:
            raise ExcitationError(f"no parameter {name!r}: {did_you_mean(base, values)}")
        if values[base] == 0 and name not in scales:
            raise ExcitationError(
                f"{name} is 0: give its size in [robot.axis.model.scales], or do not ask for it"
            )
    for names in (asked.free, asked.find):
        bases = [name.removeprefix("1/").strip() for name in names]
        if len(set(bases)) < len(bases):
            raise ExcitationError(f"a parameter is named twice: {', '.join(names)}")
