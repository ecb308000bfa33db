"""Nominal values and predictor of an axis, from its file of nominal values or from the configuration."""

from __future__ import annotations

import math
from typing import NamedTuple

from service.config.base_table import Undecidable
from service.config.nominal_file import NominalError, NominalFile, read_nominal
from service.config.schema import AxisConfig
from service.config.schema_watching import EstimatorConfig


class Predictor(NamedTuple):
    """Predictor of the output of an axis.  None: not known; the gain is then computed from the noises."""

    kind: str
    gain: tuple[float, ...]
    innovation_variance: float | None
    torque_noise: float | None
    output_noise: float | None
    torque_delay_s: float
    friction_speed_scale: float


def nominal_file_of(axis: AxisConfig) -> NominalFile | None:
    """The file of nominal values of an axis, None if it has none.

    Raises:
        Undecidable: it cannot be used, which another check reports.
    """
    if axis.model.nominal_file is None:
        return None
    try:
        return read_nominal(axis.model.nominal_file)
    except NominalError:
        raise Undecidable("nominal_file") from None


def predictor_of(axis: AxisConfig) -> Predictor:
    """The predictor of an axis, from its file of nominal values or from the configuration.

    A cross-check ensures that these do not contradict each other.
    """
    e, found = axis.estimator, nominal_file_of(axis)
    if found is None:
        return Predictor(
            e.predictor, e.gain, e.innovation_variance,
            e.torque_noise, e.output_noise or step_noise(axis),
            axis.torque_delay_s, axis.model.friction_speed_scale,
        )  # fmt: skip
    p = found.predictor
    return Predictor(
        p.kind, p.gain, p.lam0, *_noises(e, found),
        p.torque_delay_s, found.drive.friction_speed_scale,
    )  # fmt: skip


def _noises(e: EstimatorConfig, found: NominalFile) -> tuple[float | None, float | None]:
    return e.torque_noise or found.noise.torque or None, e.output_noise or found.noise.output or None


# --- What the steps of an encoder are to the estimator: noise ---------------------------------------------------------


def step_noise(axis: AxisConfig) -> float | None:
    """Standard deviation of the angle or speed from its resolution alone [rad, rad/s]; None: it is not given.

    A value anywhere within a step, each as likely: resolution / sqrt(12).
    """
    motion = axis.angle or axis.speed
    if motion is None or motion.resolution is None:
        return None
    return rounded(motion.resolution * motion.factor)


def rounded(step: float) -> float:
    """Standard deviation of what rounding to that step leaves."""
    return abs(step) / math.sqrt(12)
