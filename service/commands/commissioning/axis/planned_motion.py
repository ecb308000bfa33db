"""Plans a motion from the configuration of an axis, for excite and for commission."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.excitation import (
    Command,
    Estimation,
    ExcitationError,
    ExcitationTask,
    MotionLimits,
    PlannedExperiment,
    Plant,
    plan,
)
from monitor_core.wording import did_you_mean
from service.config import NamedAxis, drive_of, given_values
from service.config.axis_settings import axis_settings, unknown_of
from service.config.drives import axis_model
from service.config.unit_names import unit_in
from service.ingest.roles_by_name import role_of

_MAX_SAMPLES = 2_000_000


class MotionRequest(NamedTuple):
    """Requirements on a motion, with the defaults of ``excite``."""

    seconds: float = 10.0
    """Duration of a period"""
    periods: int = 2
    """Number of recorded periods after one period of warming up"""
    band_hz: tuple[float, float] = (0.0, 30.0)
    torque: float | None = None
    """Largest absolute values [N m, rad/s, rad] at the motor; None: no limit"""
    speed: float | None = None
    angle: float | None = None
    find: tuple[str, ...] = ()
    """Parameters for which the spectrum is optimised; empty: a flat spectrum"""
    free: tuple[str, ...] = ()
    """Parameters to estimate; empty: all that can be distinguished"""
    command: Command = "torque"
    """Quantity that is commanded to the axis"""

    @property
    def options(self) -> tuple[str, ...]:
        """The options of ``excite`` for this motion, as far as they are no defaults."""
        found = list[str]()
        if self.find:
            found += ["--find", ",".join(self.find)]
        if self.command != "torque":
            found += ["--as", self.command]
        if self.band_hz != MotionRequest().band_hz:
            found += ["--band", *(f"{hz:.3g}" for hz in self.band_hz)]
        for name in ("torque", "speed", "angle"):
            if (limit := getattr(self, name)) is not None:
                found += [f"--{name}-limit", f"{limit:.3g}"]
        return tuple(found)


def torque_columns(axis: NamedAxis) -> dict[str, float]:
    """Torque columns in the file of a motion and what they contain: torque [N m], and the current that produces it.

    Without a torque constant the current itself is the configured torque, with the unit A.  A share of the rated torque
    that is not converted to N m stays as in the records, since as N m it would be far too large.
    """
    source = axis.config.torque
    if source.kT_Nm_per_A is not None:
        return {"torque_Nm": 1.0, "current_A": 1.0 / source.kT_Nm_per_A}
    name = source.column if axis.config.records_only else source.signal
    unit = unit_in(name or "", "torque")
    if unit is not None and unit.factor is None and abs(source.factor) == 1:
        return {"torque_as_recorded": 1.0 / source.factor}
    return {"current_A" if name and role_of(name) == "current" else "torque_Nm": 1.0}


def angle_columns(axis: NamedAxis) -> dict[str, float]:
    """Angle columns in the file of a motion and what they contain: rad, and the unit of the records if that differs.

    That is the unit of the controller, such as degrees of the arm, or mm.
    """
    source = axis.config.angle
    recorded = {} if source is None or source.factor == 1 else {"angle_as_recorded": 1.0 / source.factor}
    return {"angle_rad": 1.0, **recorded}


def planned(axis: NamedAxis, request: MotionRequest, rng: np.random.Generator) -> PlannedExperiment:
    """Plan a motion of an axis.

    Raises:
        ExcitationError: there is no such motion, or a nominal value or a noise is unknown; the text gives the remedy.
        ValueError: a parameter that the drive does not have.
        AxisError: the axis has no predictor.
    """
    h = axis.config.sample_interval_s
    plant, estimation = _plant_and_estimation(axis)
    limits = (math.inf if limit is None else limit for limit in (request.torque, request.speed, request.angle))
    task = ExcitationTask(
        plant,
        estimation,
        MotionLimits(*limits),
        period=_samples(request.seconds, request.periods, h),
        periods=request.periods,
        band_hz=_checked_band(request.band_hz, h),
        command=request.command,
        free=request.free,
        find=request.find,
    )
    for names in (task.free, task.find):
        _check_names(names, estimation)
    return plan(task, rng)


def _plant_and_estimation(axis: NamedAxis) -> tuple[Plant, Estimation]:
    """The drive of an axis with its nominal values, and the settings of their later estimation."""
    config = axis.config
    values, h = given_values(config), config.sample_interval_s
    if missing := unknown_of(config):
        raise ExcitationError(
            f"{axis.id}: a motion is planned with the drive's values and noises, and the configuration has no"
            f" {', '.join(missing)}: give a guess, or identify a first record and name its nominal_file"
        )
    model = axis_model(config)
    settings = axis_settings(axis, model)
    K = np.array(settings.K) if settings.K else None
    if K is not None and model.drive.mean_state >= 0:  # a plan treats a mean speed as the speed at the sample
        K = np.delete(K, model.drive.mean_state)
    plant = Plant(drive_of(config, "angle"), values, h, settings.speed_scale)
    measured = drive_of(config, config.output)
    return plant, Estimation(measured, values, h, settings.lam0, K, config.model.scales)


def _samples(seconds: float, periods: int, interval_s: float) -> int:
    """Number of samples in a period."""
    if not (math.isfinite(seconds) and seconds >= 16 * interval_s):
        raise ExcitationError(f"a period of {seconds:g} s: need at least 16 samples, {16 * interval_s:g} s")
    samples = round(seconds / interval_s)
    if samples * (periods + 2) > _MAX_SAMPLES:
        raise ExcitationError(
            f"{periods} periods of {seconds:g} s have more than {_MAX_SAMPLES} samples: reduce --seconds or --periods"
        )
    return samples


def _checked_band(band_hz: tuple[float, float], interval_s: float) -> tuple[float, float]:
    (low, high), most = band_hz, 0.5 / interval_s
    if not 0 <= low < high < most:
        raise ExcitationError(f"band {low:g} {high:g}: need 0 <= low < high < {most:g} Hz, half the samples a second")
    return band_hz


def _check_names(names: Sequence[str], estimation: Estimation) -> None:
    values = estimation.values
    bases = [name.removeprefix("1/").strip() for name in names]
    for name, base in zip(names, bases, strict=True):
        if base not in values:
            raise ExcitationError(f"no parameter {name!r}: {did_you_mean(base, values)}")
        if values[base] == 0 and name not in estimation.scales:
            raise ExcitationError(f"{name} is 0: give its size in [robot.axis.model.scales], or do not ask for it")
    if len(set(bases)) < len(bases):
        raise ExcitationError(f"a parameter is named twice: {', '.join(names)}")
