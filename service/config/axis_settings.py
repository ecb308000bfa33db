"""Model and settings of the core from the configuration of an axis."""

from collections.abc import Iterator

from monitor_core.drive import AxisModel
from monitor_core.monitoring import (
    MonitoringOptions,
    recommended_settings,
    short_memory,
    unidentifiable_words,
)
from monitor_core.settings import Settings
from service.config import (
    AxisConfig,
    Config,
    NamedAxis,
    bounds_of,
    nominal_file_of,
    predictor_of,
    scales_of,
    thresholds_file_of,
    watched_drive,
    watched_values,
)
from service.config.threshold_match import with_thresholds


class AxisError(Exception):
    """An axis that cannot be monitored as configured; the text names it and says what would be right."""


def axis_model(config: AxisConfig) -> AxisModel:
    """The model of an axis."""
    drive, values = watched_drive(config), watched_values(config)
    return AxisModel(drive, values, config.model.monitor, scales_of(config), bounds_of(config))


def axis_settings(axis: NamedAxis, model: AxisModel) -> Settings:
    """Settings of the monitoring of an axis.

    Raises:
        AxisError: there is no predictor with these noises or this gain.
    """
    try:
        return _settings(axis.config, model)
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None


def _settings(config: AxisConfig, model: AxisModel) -> Settings:
    settings, found = _without_thresholds(config, model), thresholds_file_of(config)
    return settings if found is None else with_thresholds(settings, model, found)


def _without_thresholds(config: AxisConfig, model: AxisModel) -> Settings:
    return recommended_settings(model, config.sample_interval_s, _options(config, model))


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
        unidentifiable=_untold(config),
    )


def _untold(config: AxisConfig) -> tuple[tuple[str, str], ...]:
    found = nominal_file_of(config)
    return found.untold(config.model.monitor) if found else ()


def doubtful_nominals(config: Config) -> Iterator[str]:
    """A note on each axis that is not tested because its nominal values do not allow it."""
    for axis in config.axes:
        for words in unidentifiable_words(_untold(axis.config)):
            yield f"{axis.id}: {words}. Identify it with a record that moves it more variously"


def short_memories(config: Config) -> Iterator[str]:
    """A note on each axis whose memory is short compared with its predictor."""
    for axis in config.axes:
        model = axis_model(axis.config)
        short = short_memory(model, axis_settings(axis, model), axis.config.estimator.joint_state)
        if short is None:
            continue
        words = (
            f"{axis.id}: a memory of {short.memory_s:.3g} s is short compared with {short.slowest_s:.3g} s, the slowest"
            " time constant of the predictor"
        )
        if short.joint_by_default:
            yield (
                f"{words}: its state moves with the estimates (joint_state), so that they scatter as reported; from"
                f" {short.needed_s:.3g} s on this is not needed, and a change is detected up to 30 % sooner"
            )
        else:
            yield f"{words}: from {short.needed_s:.3g} s on estimates scatter as reported"
