"""From a configured axis and the requirements to an experiment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

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
    limits: Limits
    controller: Controller | None


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
    if asked.controller is not None and asked.command == "torque":
        raise ExcitationError(
            "kp and kd are those of a controller that follows speed or angle: leave them out"
        )
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
        band_hz=_band(asked, h),
        lines=asked.lines,
        command=asked.command,
        controller=asked.controller,
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


def _band(asked: Asked, interval_s: float) -> tuple[float, float]:
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
