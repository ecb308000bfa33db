"""Predictor, settings and detectors of an axis, from the configuration and the files that it names."""

import math
from dataclasses import replace
from typing import Literal, NamedTuple

from monitor_core.drive import AxisModel
from monitor_core.monitoring import MonitoringOptions, recommended_settings
from monitor_core.settings import Settings
from service.config.conditions import thermal_of
from service.config.drives import axis_model, lacking, not_identified, watched_drive, watched_values
from service.config.schema import AxisConfig, NamedAxis
from service.config.schema.thresholds_file import with_thresholds


class AxisError(Exception):
    """An axis cannot be monitored as configured; the text names it and says how to correct that."""


def monitored_model(axis: NamedAxis) -> AxisModel:
    """The model of an axis for monitoring.

    Raises:
        AxisError: nominal values or noises are missing, as the axis has not been identified yet.
    """
    check_known(axis)
    return axis_model(axis.config)


def check_known(axis: NamedAxis) -> None:
    """Check that the nominal values of the drive and the noises are known.

    Raises:
        AxisError: as ``monitored_model``.
    """
    if missing := unknown_of(axis.config):
        raise AxisError(
            f"{axis.id}: {', '.join(missing)} not known: identify the axis first, and name its nominal_file in"
            " [robot.axis.model]"
        )


def unknown_of(axis: AxisConfig) -> list[str]:
    """Names of the values of the drive and of the noises that a predictor needs but the configuration lacks."""
    predictor = predictor_of(axis)
    missing = lacking(watched_drive(axis), watched_values(axis))
    if predictor.innovation_variance is None:
        noises = ("output_noise",) if predictor.kind == "output-error" else ("torque_noise", "output_noise")
        missing += [name for name in noises if getattr(predictor, name) is None]
    return missing


class PredictorSettings(NamedTuple):
    """Settings of the predictor of an axis.  None: not known.  An empty gain is computed from the noises."""

    kind: Literal["innovations", "output-error"]
    gain: tuple[float, ...]
    innovation_variance: float | None
    largest_error: float
    torque_noise: float | None
    output_noise: float | None
    torque_delay_s: float
    friction_speed_scale: float


def predictor_of(axis: AxisConfig) -> PredictorSettings:
    """The predictor of an axis, from its nominal file or from the configuration.

    A cross-check ensures that the two do not contradict each other.
    """
    e, found = axis.estimator, axis.model.nominal_file
    if found is None:
        return PredictorSettings(
            e.predictor, (), e.innovation_variance, 0.0,
            e.torque_noise, e.output_noise or step_noise(axis),
            axis.torque_delay_s, axis.model.friction_speed_scale,
        )  # fmt: skip
    p, noise = found.predictor, found.noise
    return PredictorSettings(
        p.kind, p.gain, p.lam0, p.largest_error,
        e.torque_noise or noise.torque or None, e.output_noise or noise.output or None,
        p.torque_delay_s, found.drive.friction_speed_scale,
    )  # fmt: skip


def awaits_identification(axis: AxisConfig) -> bool:
    """Whether an identification has to find values of the drive or, for an axis of tables, the noises beside them.

    Values that are given to start an identification from have no noises.
    """
    known = predictor_of(axis)
    if known.kind == "output-error":
        noises = known.innovation_variance is not None or known.output_noise is not None
    else:
        noises = bool(known.gain) or (known.torque_noise is not None and known.output_noise is not None)
    return not_identified(axis) or (axis.to_be_identified and axis.records_only and not noises)


def step_noise(axis: AxisConfig) -> float | None:
    """Standard deviation of the angle or speed from its resolution alone [rad, rad/s]; None: no resolution is given."""
    motion = axis.angle or axis.speed
    if motion is None or motion.resolution is None:
        return None
    return rounded(motion.resolution * motion.factor)


def rounded(step: float) -> float:
    """Standard deviation of the error of rounding to this step, which is uniformly distributed."""
    return abs(step) / math.sqrt(12)


def axis_settings(axis: NamedAxis, model: AxisModel) -> Settings:
    """The monitoring settings of an axis.

    Raises:
        AxisError: no predictor has these noises or this gain, or the thresholds belong to another monitor.
    """
    config = axis.config
    try:
        settings = recommended_settings(model, config.sample_interval_s, _options(config, model))
        settings = replace(settings, model_error=model_error(config, model))
        thresholds = config.model.thresholds_file
        return settings if thresholds is None else with_thresholds(settings, model, thresholds)
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None


def _options(config: AxisConfig, model: AxisModel) -> MonitoringOptions:
    p, e, P0 = predictor_of(config), config.estimator, config.estimator.initial_p
    return MonitoringOptions(
        torque_noise=p.torque_noise,
        output_noise=p.output_noise,
        innovation_variance=p.innovation_variance,
        largest_error=p.largest_error,
        gain=p.gain,
        output_error=p.kind == "output-error",
        lam=config.forgetting,
        joint_state=e.joint_state,
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
        unidentifiable=unidentifiable_pairs(config),
    )


def model_error(config: AxisConfig, model: AxisModel) -> tuple[float, ...]:
    """Error of each parameter that remains beside the temperature or the heat, in sizes; empty: none is known."""
    found = config.model.nominal_file
    if found is None:
        return ()
    errors = {s.parameter: s.model_error for s in found.schedule if s.model_error}
    if found.thermal is not None and thermal_of(config) is not None:
        errors |= found.thermal.model_error
    elif not errors:
        return ()
    size = model.scale
    return tuple(errors.get(name, 0.0) / float(s) for name, s in zip(model.monitored, size, strict=True))


def unidentifiable_pairs(config: AxisConfig) -> tuple[tuple[str, str], ...]:
    """Pairs of parameters that the identification record hardly distinguishes."""
    found = config.model.nominal_file
    return found.unidentifiable_pairs(config.model.monitor) if found else ()
