"""From the configuration of an axis to the engine's model and settings."""

from collections.abc import Sequence

import numpy as np

from monitor_core.kalman import filter_gain, slowest_time_constant
from monitor_core.model import AxisModel
from monitor_core.settings import Settings
from service.config import AxisConfig, NamedAxis, Predictor, drive_of, given_values, predictor_of

SETTLING_TIME_CONSTANTS = 5
"""After so many of its slowest time constants the predictor has forgotten where it started (e^-5 = 0.7 %)."""


class AxisError(Exception):
    """An axis that cannot be monitored as configured; the text names it and says what would be right."""


def axis_model(config: AxisConfig) -> AxisModel:
    """The model of an axis."""
    m = config.model
    return AxisModel(drive_of(config), given_values(config), m.monitor, dict(m.scales), dict(m.bounds))


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
    predictor = predictor_of(config)
    K, lam0 = _gain(config, predictor, model)
    P0 = config.estimator.initial_p
    return Settings(
        interval_s=config.sample_interval_s,
        lam=config.estimator.forgetting,
        lam0=lam0,
        alpha1=config.detector.alpha_1,
        alpha2=config.detector.alpha_2,
        K=tuple(K),
        delay_s=predictor.torque_delay_s,
        max_gap_s=config.maximum_gap_s,
        settle_s=_settling_time(config, model, K),
        speed_scale=predictor.friction_speed_scale,
        P0=tuple(P0[name] for name in model.monitored) if P0 else (),
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


def _settling_time(config: AxisConfig, model: AxisModel, K: Sequence[float]) -> float:
    gain = np.array(K) if K else np.zeros(len(model.drive.states))
    slowest = slowest_time_constant(model, gain, config.sample_interval_s)
    if not np.isfinite(slowest):
        raise ValueError("the predictor is not stable: give another gain, or torque_noise and output_noise")
    given = config.settling_time_s
    return SETTLING_TIME_CONSTANTS * slowest if given is None else given
