"""From the configuration of an axis to the engine's model and settings."""

from collections.abc import Iterator, Sequence

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, gains_after, slowest_time_constant
from monitor_core.drive.structure import DISTURBANCE_TIME
from monitor_core.monitoring.observability import untold
from monitor_core.settings import Settings
from service.config import (
    AxisConfig,
    Config,
    NamedAxis,
    Predictor,
    bounds_of,
    nominal_file_of,
    predictor_of,
    scales_of,
    thresholds_file_of,
    watched_drive,
    watched_values,
)
from service.config.threshold_match import with_thresholds

SETTLING_TIME_CONSTANTS = 5
"""After so many of its slowest time constants the predictor has forgotten where it started (e^-5 = 0.7 %)."""
LEAST_MEMORY, AMPLE_MEMORY = 0.5, 2.5
"""Memory over the slowest time constant: below the first theta runs away, from the second on it scatters as P says;
the paper's own experiment has 1.8.  Between them the state moves with the estimates, or the configuration says no."""
JOINT = 0.2
"""Of that where the configuration says that the state moves with the estimates: then they do not run away."""
LOST_SAMPLE = 0.1
"""Part of the settling time that each lost sample but the first of a row costs: nine of them, nearly all of it."""


class AxisError(Exception):
    """An axis that cannot be monitored as configured; the text names it and says what would be right."""


def axis_model(config: AxisConfig) -> AxisModel:
    """The model of an axis."""
    drive, values = watched_drive(config), watched_values(config)
    return AxisModel(drive, values, config.model.monitor, scales_of(config), bounds_of(config))


def axis_settings(axis: NamedAxis, model: AxisModel) -> Settings:
    """How an axis is monitored.

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
    predictor = predictor_of(config)
    K, lam0 = _gain(config, predictor, model)
    P0, settle_s = config.estimator.initial_p, _settling_time(config, model, K)
    return Settings(
        interval_s=config.sample_interval_s,
        lam=config.forgetting,
        lam0=lam0,
        alpha1=config.detector.alpha_1,
        alpha2=config.detector.alpha_2,
        K=tuple(K),
        K_after=_later_gains(config, predictor, model, K),
        delay_s=predictor.torque_delay_s,
        max_gap_s=config.max_gap_s,
        settle_s=settle_s,
        lost_s=settle_s * LOST_SAMPLE,
        speed_scale=predictor.friction_speed_scale,
        P0=tuple(P0[name] for name in model.monitored) if P0 else (),
        floor=config.estimator.information_floor,
        starved=config.estimator.min_excitation,
        outlier=config.estimator.outlier_limit,
        joint=_joint(config, model, K),
        drift=config.estimator.random_walk,
        widen=config.detector.covariance_reset,
        untold=_untold(config),
    )


def _gain(config: AxisConfig, p: Predictor, model: AxisModel) -> tuple[Sequence[float], float]:
    """Filter gain K, empty for output error, and lambda_0; what is given goes before what is computed."""
    if p.kind == "output-error":
        assert p.innovation_variance is not None or p.output_noise is not None  # a rule of the configuration
        return (), p.innovation_variance or (p.output_noise or 0.0) ** 2
    if p.gain and p.innovation_variance is not None:
        return p.gain, p.innovation_variance
    assert p.torque_noise is not None  # both are a rule of the configuration
    assert p.output_noise is not None
    K, lam0 = filter_gain(model, config.sample_interval_s, p.torque_noise, p.output_noise)
    return p.gain or tuple(float(k) for k in K), p.innovation_variance or lam0


def _later_gains(
    config: AxisConfig, p: Predictor, model: AxisModel, K: Sequence[float]
) -> tuple[tuple[float, ...], ...]:
    """How K grows while samples are missing; empty, for no growth, where its noises are not known."""
    if not K or p.torque_noise is None or p.output_noise is None or DISTURBANCE_TIME in model.nominal:
        return ()
    noises = config.sample_interval_s, p.torque_noise, p.output_noise
    computed, _ = filter_gain(model, *noises)
    return gains_after(model, *noises) if np.allclose(computed, K, rtol=1e-3, atol=0) else ()


def _settling_time(config: AxisConfig, model: AxisModel, K: Sequence[float]) -> float:
    slowest = _slowest(config, model, K)
    if not np.isfinite(slowest):
        raise ValueError("the predictor is not stable: give another gain, or torque_noise and output_noise")
    least = LEAST_MEMORY * slowest * (JOINT if config.estimator.joint_state else 1)
    if memory_s(config) < least:
        raise ValueError(
            f"a memory of {memory_s(config):.3g} s is less than {least:.3g} s, too short for the slowest time constant"
            f" of the predictor, {slowest:.3g} s: the estimates would run away. Raise memory_s, or torque_noise, with"
            " which it is faster"
        )
    given = config.settling_time_s
    return SETTLING_TIME_CONSTANTS * slowest if given is None else given


def _joint(config: AxisConfig, model: AxisModel, K: Sequence[float]) -> bool:
    """Whether the state moves with the estimates: as said, else where these would scatter more than is reported."""
    said = config.estimator.joint_state
    return memory_s(config) < AMPLE_MEMORY * _slowest(config, model, K) if said is None else said


def _slowest(config: AxisConfig, model: AxisModel, K: Sequence[float]) -> float:
    gain = np.array(K) if K else np.zeros(len(model.drive.states))
    return slowest_time_constant(model, gain, config.sample_interval_s)


def memory_s(config: AxisConfig) -> float:
    """Memory of the estimates [s]."""
    return config.sample_interval_s / (1 - config.forgetting)


def _untold(config: AxisConfig) -> tuple[tuple[str, str], ...]:
    found = nominal_file_of(config)
    return found.untold(config.model.monitor) if found else ()


def doubtful_nominals(config: Config) -> Iterator[str]:
    """A note on each axis that is not tested, as its nominal values do not allow it."""
    for axis in config.axes:
        for words in untold(_untold(axis.config)):
            yield f"{axis.id}: {words}. Identify it with a record that moves it more variously"


def short_memories(config: Config) -> Iterator[str]:
    """Axes whose estimates will scatter more than is reported, in words."""
    for axis in config.axes:
        model = axis_model(axis.config)
        settings = axis_settings(axis, model)
        slowest, memory = _slowest(axis.config, model, settings.K), memory_s(axis.config)
        short = f"{axis.id}: a memory of {memory:.3g} s is short beside {slowest:.3g} s, the slowest time constant of"
        by_itself = axis.config.estimator.joint_state is None
        ample = AMPLE_MEMORY * slowest * (JOINT if settings.joint and not by_itself else 1)
        if memory < ample and settings.joint and by_itself:
            yield (
                f"{short} the predictor: its state moves with the estimates (joint_state), so that they scatter as"
                f" reported; with {ample:.3g} s or more it need not, and a change is seen up to 30 % sooner"
            )
        elif memory < ample:
            yield f"{short} the predictor: from {ample:.3g} s on estimates scatter as reported"
