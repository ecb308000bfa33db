"""Candidate changes: the monitored parameters up and down in several sizes, and faults of the sensors."""

import math
from collections.abc import Callable

import numpy as np

from monitor_core.detection.multimodel.hypothesis import Distortion, Hypothesis
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import DELAY, split_name
from monitor_core.kernel.tables import TORQUE
from monitor_core.settings import Settings

SIZES = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Of the logarithm of a factor, or in units of a parameter's scale.  Of the evidence of a change that lies between two
sizes in the ratio 2 its neighbours keep 8/9 at least: with d the change and s a size it is proportional to 2 s d - s^2,
at most d^2."""
_DELAYS = (0.125, 0.35, 1.0)
_OFFSETS = (0.3, 1.2)
_NOISES = (1.5, 3.0)
_LOST = (2.0, 16.0)
_LAST = 0.01
"""How likely it is beforehand, beside the others, that a signal is another one altogether, a scale that never changes
is, or that there is nothing but noise."""
_BISECTIONS = 24

TORQUE_SCALE, OUTPUT_SCALE = "torque scale", "output scale"
TORQUE_SIGN, OUTPUT_SIGN = "torque sign", "output sign"
TORQUE_OFFSET, OUTPUT_OFFSET = "torque offset", "output offset"
TORQUE_STUCK, TORQUE_LOST = "torque stuck", "torque lost"
OUTPUT_STUCK, OUTPUT_NOISE = "output stuck", "output noise"
SENSOR_FAULTS = (
    *(TORQUE_SCALE, OUTPUT_SCALE, TORQUE_SIGN, OUTPUT_SIGN, TORQUE_OFFSET, OUTPUT_OFFSET),
    *(TORQUE_STUCK, TORQUE_LOST, OUTPUT_STUCK, OUTPUT_NOISE, DELAY),
)


def candidates(model: AxisModel, settings: Settings, sensors: bool = True) -> tuple[Hypothesis, ...]:
    """All candidate changes of an axis."""
    plan = {name: _both(SIZES) for name in model.monitored if name != DELAY}
    plan |= _sensor_plan(model) if sensors else {}
    return tuple(
        hypothesis_of(model, settings, cause, size) for cause, sizes in plan.items() for size in sizes
    )


def _sensor_plan(model: AxisModel) -> dict[str, tuple[float, ...]]:
    return {
        TORQUE_SCALE: _both(SIZES),
        OUTPUT_SCALE: _both(SIZES),
        TORQUE_SIGN: (math.nan,),
        OUTPUT_SIGN: (math.nan,),
        DELAY: _both(_DELAYS),
        TORQUE_OFFSET: _both(_OFFSETS),
        # A predictor of the angle follows an offset of the angle.
        OUTPUT_OFFSET: () if model.drive.output == "angle" else _both(_OFFSETS),
        TORQUE_STUCK: tuple(math.log(ratio) for ratio in _LOST),
        TORQUE_LOST: tuple(math.log(ratio) for ratio in _LOST),
        OUTPUT_STUCK: (math.nan,),
        OUTPUT_NOISE: tuple(math.log(ratio) for ratio in _NOISES),
    }


def hypothesis_of(model: AxisModel, settings: Settings, cause: str, size: float) -> Hypothesis:
    """The hypothesis of a cause and a size.

    Raises:
        KeyError: there is no such cause.
    """
    if cause in model.monitored and cause != DELAY:
        return _of_parameter(model, cause, size)
    if cause in (TORQUE_STUCK, TORQUE_LOST):
        return _lost_torque(model, settings, cause, size)
    if cause == TORQUE_OFFSET:
        return Hypothesis(cause, size, torque=Distortion(offset=size * torque_unit(model, settings)))
    if cause == OUTPUT_NOISE:
        # Any change looks like noise at first, while the state of the axis is still that of before.
        return Hypothesis(cause, size, variance=math.exp(2 * size), weight=_LAST)
    plain: dict[str, Callable[[], Hypothesis]] = {
        TORQUE_SCALE: lambda: Hypothesis(cause, size, torque=Distortion(math.exp(size))),
        # The scale of an encoder is fixed by design, and a change looks almost like one of kT: a last resort.
        OUTPUT_SCALE: lambda: Hypothesis(cause, size, output=Distortion(math.exp(size)), weight=_LAST),
        TORQUE_SIGN: lambda: Hypothesis(cause, torque=Distortion(-1.0)),
        OUTPUT_SIGN: lambda: Hypothesis(cause, output=Distortion(-1.0)),
        DELAY: lambda: Hypothesis(cause, size, delay_s=size * settings.interval_s),
        OUTPUT_OFFSET: lambda: Hypothesis(
            cause, size, output=Distortion(offset=size * math.sqrt(settings.lam0))
        ),
        OUTPUT_STUCK: lambda: Hypothesis(cause, frozen=True),
    }
    return plain[cause]()


def unit_of(model: AxisModel, settings: Settings, cause: str) -> tuple[float, str]:
    """Value in SI and unit of a size of 1 of a cause; the unit "log" means that sizes are logarithms of factors."""
    if cause == DELAY:
        return settings.interval_s, "s"
    if cause == TORQUE_OFFSET:
        return torque_unit(model, settings), "N m"
    if cause == OUTPUT_OFFSET:
        return math.sqrt(settings.lam0), "rad" if model.drive.output == "angle" else "rad/s"
    if cause in model.monitored and not model.nominal[split_name(cause)[0]] > 0:
        return _scale(model, cause), model.drive.parameter(cause).unit
    return 1.0, "log"


def _scale(model: AxisModel, name: str) -> float:
    return model.scales.get(name, abs(model.nominal[split_name(name)[0]]))


def _of_parameter(model: AxisModel, name: str, size: float) -> Hypothesis:
    """The parameter times exp(size), or, where it is zero or negative, plus size times its scale."""
    base, inverse = split_name(name)
    if model.nominal[base] > 0:
        return Hypothesis(name, size, factors={base: math.exp(-size if inverse else size)})
    return Hypothesis(name, size, shifts={base: size * _scale(model, name)})


def torque_unit(model: AxisModel, s: Settings) -> float:
    """The constant torque [N m] that moves the predicted output by sqrt(lam0) within a memory."""
    A, B, C = model.matrices()
    torque = B[:, [kind == TORQUE for kind in model.drive.inputs]].sum(axis=1, keepdims=True)
    K, mean = s.gain(len(A))[:, np.newaxis], model.drive.mean_state
    Ad, Bd = zero_order_hold(A, torque, s.interval_s)
    x, most = np.zeros((len(A), 1)), 0.0
    for _ in range(round(s.memory)):
        x = Ad @ x + Bd
        e = (C @ x).item() / (s.interval_s if mean >= 0 else 1.0)
        x -= K * e
        if mean >= 0:
            x[mean] = 0.0
        most = max(most, abs(e))
    return math.sqrt(s.lam0) / most


def _lost_torque(model: AxisModel, s: Settings, cause: str, size: float) -> Hypothesis:
    """The measured torque is not the one that acts: a predictor for which the torque is only random.

    The size of that torque is unknown, too; ``size`` is its effect on the variance of the innovations.
    """
    noise = math.sqrt(s.lam0 * (1 - _corrected(model, s)))
    K, lam = _random_torque(model, s.interval_s, noise, math.exp(size) * s.lam0)
    weight, still = (1.0, True) if cause == TORQUE_STUCK else (_LAST, False)
    return Hypothesis(
        cause, size, torque=Distortion(0.0), K=K, variance=lam / s.lam0, still=still, weight=weight
    )


def _corrected(model: AxisModel, s: Settings) -> float:
    """C K: the part of the innovations' variance without it is the noise of the output."""
    C = model.matrices()[2][0] / (s.interval_s if model.drive.mean_state >= 0 else 1.0)
    return float(min(C @ s.gain(len(C)), 0.99))


def _random_torque(
    model: AxisModel, interval_s: float, noise: float, lam: float
) -> tuple[tuple[float, ...], float]:
    """Gain and innovation variance for the torque noise that gives the variance ``lam``; by bisection."""
    low, high = -12.0, 12.0
    K, found = filter_gain(model, interval_s, noise, noise)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        K, found = filter_gain(model, interval_s, math.exp(middle) * noise, noise)
        low, high = (middle, high) if found < lam else (low, middle)
    return tuple(float(k) for k in K), found


def _both(sizes: tuple[float, ...]) -> tuple[float, ...]:
    return (*(-size for size in reversed(sizes)), *sizes)
