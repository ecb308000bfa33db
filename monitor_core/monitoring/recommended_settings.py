"""Recommended settings for a real axis, computed from its model and the noise of its signals.

The settings have a Kalman gain from the noise of the signals, a settling time from the predictor, supervision of P, and
outlier rejection.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain, gains_after, slowest_time_constant
from monitor_core.drive.structure import DISTURBANCE_TIME
from monitor_core.settings import Settings
from monitor_core.wording import listed, rounded_up

SETTLING_TIME_CONSTANTS = 5
"""After this number of its slowest time constants the predictor has forgotten its initial state (e^-5 = 0.7 %)."""
MIN_MEMORY, AMPLE_MEMORY = 0.5, 2.5
"""Limits of the ratio of the memory to the slowest time constant of the predictor.  Below the first the estimates run
away; above the second they scatter as P says (the paper's own experiment has 1.8).  Between them the default is a joint
state."""
JOINT_STATE_SHARE = 0.2
"""Share of these limits that suffices with a joint state."""
LOST_SAMPLE_SHARE = 0.1
"""Share of the settling time without updates after each lost sample, except the first in a row."""
DEFAULT_MEMORY_S, MIN_MEMORY_SAMPLES = 1.0, 10
"""Default memory [s], and the least number of samples in it."""

_COPIED_OPTIONS = (
    *("alpha1", "alpha2", "P0", "information_floor", "min_excitation", "outlier_limit"),
    *("largest_error", "covariance_reset", "unidentifiable"),
)
"""Options that are copied to the settings"""


class SettingsError(ValueError):
    """There is no working predictor with these options; the text says what would be right."""


@dataclass(frozen=True)
class MonitoringOptions:
    """Options for the monitoring of an axis; the defaults are recommended for real axes.

    Attributes:
        torque_noise: standard deviation of the torque per sample [N m], including what the model does not explain.
        output_noise: standard deviation of the measured angle [rad] or speed [rad/s].
        innovation_variance: lambda_0 [rad^2 or (rad/s)^2]; None: from the noises.
        largest_error: largest innovation of the healthy records, without outliers, in the unit of the output; 0: not
            known, then ``outlier_limit`` alone counts.
        gain: filter gain K, one number per state; empty: from the noises.
        output_error: the paper's predictor, K = 0; only with speed.
        lam: forgetting factor per sample; None: from ``memory_s``.
        memory_s: memory of the estimates [s].
        joint_state: whether the state is corrected together with theta; None: yes if the memory is short.
        information_floor: share of the information at commissioning that is never forgotten.
        min_excitation: share of the usual excitation below which the estimates are not updated.
        outlier_limit: an innovation beyond this number of standard deviations is rejected.
        torque_delay_s: delay of the torque [s].
        friction_speed_scale: speed scale of Coulomb friction [rad/s].
        max_gap_s: a longer interval restarts the predictor [s]; None: ten intervals.
        settling_time_s: no estimation for this time after a restart [s]; None: five times the slowest time constant.
        P0: diagonal of P(0); empty: from the first samples.
        alpha1: nu = alpha1 sqrt(lambda_0 P_ii) (paper eq. 22).
        alpha2: h = alpha2 s_i (paper eq. 23).
        covariance_reset: after an alarm P_ii is at least this many times P(0)_ii.
        unidentifiable: pairs of parameters that the record of the nominal values does not distinguish.
    """

    torque_noise: float | None = None
    output_noise: float | None = None
    innovation_variance: float | None = None
    largest_error: float = 0.0
    gain: tuple[float, ...] = ()
    output_error: bool = False
    lam: float | None = None
    memory_s: float | None = None
    joint_state: bool | None = None
    information_floor: float = 0.05
    min_excitation: float = 0.05
    outlier_limit: float = 6.0
    torque_delay_s: float = 0.0
    friction_speed_scale: float = 1.0
    max_gap_s: float | None = None
    settling_time_s: float | None = None
    P0: tuple[float, ...] = ()
    alpha1: float = 3.0
    alpha2: float = 20.0
    covariance_reset: float = 0.0
    unidentifiable: tuple[tuple[str, str], ...] = ()

    def forgetting(self, interval_s: float) -> float:
        """Forgetting factor lambda per sample: ``lam``, or from the memory."""
        if self.lam is not None:
            return self.lam
        return 1 - interval_s / (self.memory_s or max(DEFAULT_MEMORY_S, MIN_MEMORY_SAMPLES * interval_s))


def recommended_settings(model: AxisModel, interval_s: float, options: MonitoringOptions) -> Settings:
    """Settings for an axis.

    Args:
        model: the axis with its nominal values and monitored parameters.
        interval_s: nominal sample interval [s].
        options: usually with at least ``torque_noise`` and ``output_noise``.

    Raises:
        SettingsError: noises are missing, the predictor is not stable, or the memory is too short for it.
        ValueError: an option out of range.
    """
    K, lam0 = _gain(model, interval_s, options)
    lam, slowest_s = options.forgetting(interval_s), time_constant(model, interval_s, K)
    memory_s, joint = interval_s / (1 - lam), options.joint_state
    _check_memory(model, interval_s, options, memory_s, slowest_s)
    settle_s = options.settling_time_s
    settle_s = SETTLING_TIME_CONSTANTS * slowest_s if settle_s is None else settle_s
    return Settings(
        interval_s=interval_s,
        lam=lam,
        lam0=lam0,
        K=tuple(K),
        K_after=_gains_after_gaps(model, interval_s, options, K),
        delay_s=options.torque_delay_s,
        max_gap_s=10 * interval_s if options.max_gap_s is None else options.max_gap_s,
        settle_s=settle_s,
        lost_s=settle_s * LOST_SAMPLE_SHARE,
        speed_scale=options.friction_speed_scale,
        # Default: a joint state if the estimates would otherwise scatter more than reported.
        joint_state=bool(memory_s < AMPLE_MEMORY * slowest_s) if joint is None else joint,
        **{name: getattr(options, name) for name in _COPIED_OPTIONS},
    )


@dataclass(frozen=True)
class ShortMemory:
    """A memory that is short for the predictor; times in seconds.

    ``needed_s``: shortest memory with which the estimates scatter as reported.  ``joint_by_default``: the settings have
    a joint state because the memory is short, so the estimates scatter as reported.
    """

    memory_s: float
    slowest_s: float
    needed_s: float
    joint_by_default: bool


def short_memory(model: AxisModel, settings: Settings, joint_state: bool | None) -> ShortMemory | None:
    """Compare the memory with the predictor; None: it is long enough.  ``joint_state``: as in the options."""
    slowest = time_constant(model, settings.interval_s, settings.K)
    memory = settings.memory * settings.interval_s
    chosen = joint_state is not None
    needed = AMPLE_MEMORY * slowest * (JOINT_STATE_SHARE if settings.joint_state and chosen else 1)
    if memory >= needed:
        return None
    return ShortMemory(memory, slowest, needed, settings.joint_state and not chosen)


def time_constant(model: AxisModel, interval_s: float, K: Sequence[float]) -> float:
    """Slowest time constant [s] of the predictor with filter gain K; empty: output error."""
    gain = np.array(K) if K else np.zeros(len(model.drive.states))
    return slowest_time_constant(model, gain, interval_s)


def _gain(model: AxisModel, interval_s: float, o: MonitoringOptions) -> tuple[Sequence[float], float]:
    """Filter gain K (empty for output error), and lambda_0; values in the options take precedence."""
    if o.output_error:
        if o.innovation_variance is None and o.output_noise is None:
            raise SettingsError("output error needs output_noise or innovation_variance")
        return (), o.innovation_variance or (o.output_noise or 0.0) ** 2
    if o.gain and o.innovation_variance is not None:
        return o.gain, o.innovation_variance
    if o.torque_noise is None or o.output_noise is None:
        raise SettingsError("the filter gain needs torque_noise and output_noise")
    K, lam0 = filter_gain(model, interval_s, o.torque_noise, o.output_noise)
    return o.gain or tuple(float(k) for k in K), o.innovation_variance or lam0


def _gains_after_gaps(
    model: AxisModel, interval_s: float, o: MonitoringOptions, K: Sequence[float]
) -> tuple[tuple[float, ...], ...]:
    """The gains after missing samples; empty (K is used) if the noises that K belongs to are not known."""
    if not K or o.torque_noise is None or o.output_noise is None or DISTURBANCE_TIME in model.nominal:
        return ()
    noises = interval_s, o.torque_noise, o.output_noise
    computed, _ = filter_gain(model, *noises)
    return gains_after(model, *noises) if np.allclose(computed, K, rtol=1e-3, atol=0) else ()


def shortest_memory(slowest_s: float, joint_state: bool) -> float:
    """Shortest memory [s] with which the estimates do not run away, from the predictor's slowest time constant [s]."""
    return MIN_MEMORY * slowest_s * (JOINT_STATE_SHARE if joint_state else 1)


def _check_memory(model: AxisModel, interval_s: float, o: MonitoringOptions, memory_s: float, slowest_s: float) -> None:
    """Check that the predictor is stable, and the memory long enough for its slowest time constant.

    Raises:
        SettingsError: one of them is not; the text says what would be right.
    """
    if not np.isfinite(slowest_s):
        raise SettingsError("the predictor is not stable: give another gain, or torque_noise and output_noise")
    least = shortest_memory(slowest_s, bool(o.joint_state))
    if memory_s >= least:
        return
    ways = [f"raise memory_s to {rounded_up(least):g}"]
    if not o.joint_state and memory_s >= shortest_memory(slowest_s, joint_state=True):
        ways.insert(0, "set joint_state = true")
    if noise := _faster_noise(model, interval_s, o, memory_s):
        ways.append(f"raise torque_noise to {noise:g}, which makes the predictor faster")
    raise SettingsError(
        f"a memory of {memory_s:.3g} s is less than {least:.3g} s, too short for the slowest time constant of the"
        f" predictor, {slowest_s:.3g} s: the estimates would run away. {listed(ways, 'or').capitalize()}"
    )


_NOISIER = (1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 20.0, 50.0, 100.0)


def _faster_noise(model: AxisModel, interval_s: float, o: MonitoringOptions, memory_s: float) -> float | None:
    """The smallest of some larger torque noises with which the memory is long enough; None: there is none.

    All are tried, as more noise does not always make the predictor faster.
    """
    if o.gain or o.output_error or o.torque_noise is None or o.output_noise is None:
        return None
    for factor in _NOISIER:
        noise = rounded_up(factor * o.torque_noise)
        K, _ = filter_gain(model, interval_s, noise, o.output_noise)
        if memory_s >= shortest_memory(slowest_time_constant(model, K, interval_s), bool(o.joint_state)):
            return noise
    return None
