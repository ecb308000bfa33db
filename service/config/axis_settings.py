"""Predictor and settings of the monitoring of an axis, from the configuration and the files that it names."""

from __future__ import annotations

import math
from typing import NamedTuple

from monitor_core.drive import AxisModel
from monitor_core.monitoring import MonitoringOptions, recommended_settings
from monitor_core.settings import Settings
from service.config.drives import axis_model
from service.config.nominal_file import nominal_file_of
from service.config.schema import AxisConfig, NamedAxis
from service.config.thresholds_file import thresholds_file_of, with_thresholds

__all__ = [
    "AxisError",
    "Predictor",
    "axis_model",
    "axis_settings",
    "predictor_of",
    "rounded",
    "step_noise",
    "untold",
]


class AxisError(Exception):
    """An axis that cannot be monitored as configured; the text names it and says what would be right."""


class Predictor(NamedTuple):
    """Predictor of the output of an axis.  None: not known; the gain is then computed from the noises."""

    kind: str
    gain: tuple[float, ...]
    innovation_variance: float | None
    torque_noise: float | None
    output_noise: float | None
    torque_delay_s: float
    friction_speed_scale: float


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
    p, noise = found.predictor, found.noise
    return Predictor(
        p.kind, p.gain, p.lam0,
        e.torque_noise or noise.torque or None, e.output_noise or noise.output or None,
        p.torque_delay_s, found.drive.friction_speed_scale,
    )  # fmt: skip


def step_noise(axis: AxisConfig) -> float | None:
    """Standard deviation of the angle or speed from its resolution alone [rad, rad/s]; None: it is not given."""
    motion = axis.angle or axis.speed
    if motion is None or motion.resolution is None:
        return None
    return rounded(motion.resolution * motion.factor)


def rounded(step: float) -> float:
    """Standard deviation of what rounding to that step leaves: any value within a step, each as likely."""
    return abs(step) / math.sqrt(12)


def axis_settings(axis: NamedAxis, model: AxisModel) -> Settings:
    """Settings of the monitoring of an axis.

    Raises:
        AxisError: there is no predictor with these noises or this gain, or its thresholds are of another monitor.
    """
    config = axis.config
    try:
        settings = recommended_settings(model, config.sample_interval_s, _options(config, model))
        thresholds = thresholds_file_of(config)
        return settings if thresholds is None else with_thresholds(settings, model, thresholds)
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None


def _options(config: AxisConfig, model: AxisModel) -> MonitoringOptions:
    p, e, P0 = predictor_of(config), config.estimator, config.estimator.initial_p
    return MonitoringOptions(
        torque_noise=p.torque_noise,
        output_noise=p.output_noise,
        innovation_variance=p.innovation_variance,
        gain=tuple(p.gain),
        output_error=p.kind == "output-error",
        lam=config.forgetting,
        joint_state=e.joint_state,
        random_walk=e.random_walk,
        information_floor=e.information_floor,
        min_excitation=e.min_excitation,
        outlier_limit=e.outlier_limit,
        torque_delay_s=p.torque_delay_s,
        friction_speed_scale=p.friction_speed_scale,
        max_gap_s=config.max_gap_s,
        settling_time_s=config.settling_time_s,
        P0=tuple(P0[name] for name in model.monitored) if P0 else (),
        alpha1=config.detector.alpha_1,
        alpha2=config.detector.alpha_2,
        covariance_reset=config.detector.covariance_reset,
        unidentifiable=untold(config),
    )


def untold(config: AxisConfig) -> tuple[tuple[str, str], ...]:
    """Pairs of parameters that the record of the nominal values hardly distinguishes."""
    found = nominal_file_of(config)
    return found.untold(config.model.monitor) if found else ()
