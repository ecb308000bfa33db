"""Candidate changes: the monitored parameters up and down in several sizes, another payload, faults of the sensors.

Also converts their sizes to physical units (``quantity_of``).
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from monitor_core.detection.alarm import (
    INERTIA,
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    SENSOR_FAULTS,
    TORQUE_CONSTANT,
    TORQUE_LOST,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
)
from monitor_core.detection.multimodel.hypothesis import Distortion, Hypothesis
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.kalman import filter_gain, slowest_time_constant
from monitor_core.drive.structure import DELAY, LOAD, split_name
from monitor_core.kernel.tables import TORQUE
from monitor_core.settings import Settings

SIZES = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Sizes: logarithms of a factor, or in units of a parameter's scale.  With the ratio 2 between sizes, the nearest
hypothesis gets at least 8/9 of the full evidence of a change: for a change d and a hypothesis s the evidence is
proportional to 2 s d - s^2, at most d^2."""
_DELAYS = (0.125, 0.35, 1.0)
_OFFSETS = (0.3, 1.2)
_NOISES = (1.5, 3.0)
_LOST = (2.0, 16.0)
_LAST = 0.01
"""Prior weight of causes of last resort: a torque that is not the acting one, a wrong output scale, more noise."""
_BISECTIONS = 24
_LOAD_INERTIA_SHARE = 0.5
"""A payload increases the inertia by this share of its increase of the weight: the inertia of the rotor stays the
same."""


def candidates(model: AxisModel, settings: Settings) -> tuple[Hypothesis, ...]:
    """All candidate changes of an axis."""
    lost, noises = (tuple(math.log(ratio) for ratio in ratios) for ratios in (_LOST, _NOISES))
    sizes = {name: _both(SIZES) for name in (*model.monitored, *_payload(model)) if name != DELAY} | {
        TORQUE_SCALE: _both(SIZES),
        OUTPUT_SCALE: _both(SIZES),
        TORQUE_SIGN: (math.nan,),
        OUTPUT_SIGN: (math.nan,),
        DELAY: _both(_DELAYS),
        TORQUE_OFFSET: _both(_OFFSETS),
        # A predictor of the angle follows an offset of the angle.
        OUTPUT_OFFSET: () if model.drive.output == "angle" else _both(_OFFSETS),
        TORQUE_STUCK: lost,
        TORQUE_LOST: lost,
        OUTPUT_STUCK: (math.nan,),
        OUTPUT_NOISE: noises,
    }
    return tuple(hypothesis_of(model, settings, cause, size) for cause, own in sizes.items() for size in own)


def hypothesis_of(model: AxisModel, settings: Settings, cause: str, size: float) -> Hypothesis:
    """The hypothesis of a cause and a size.

    Raises:
        KeyError: there is no such cause.
    """
    if cause in model.monitored and cause != DELAY:
        return _of_parameter(model, settings, cause, size)
    inertia = model.arm_inertia()
    if cause == INERTIA and inertia is not None:
        return Hypothesis(cause, size, factors={inertia: math.exp(size)})
    if cause == LOAD and (weight := model.carried_weight()):
        factors = dict.fromkeys(weight, math.exp(size))
        if inertia is not None:
            factors[inertia] = math.exp(_LOAD_INERTIA_SHARE * size)
        return Hypothesis(cause, size, factors=factors)
    if cause in (TORQUE_STUCK, TORQUE_LOST):
        return _lost_torque(model, settings, cause, size)
    if cause == TORQUE_OFFSET:
        return Hypothesis(cause, size, torque=Distortion(offset=size * torque_unit(model, settings)))
    if cause == OUTPUT_NOISE:
        # Any change looks like noise at first, while the state of the predictor has not settled.
        return Hypothesis(cause, size, variance=math.exp(2 * size), weight=_LAST)
    plain: dict[str, Callable[[], Hypothesis]] = {
        TORQUE_SCALE: lambda: Hypothesis(cause, size, torque=Distortion(math.exp(size)), is_gain=True),
        # A last resort: the scale of an encoder is fixed by design, and a change of it looks almost like one of kT.
        OUTPUT_SCALE: lambda: Hypothesis(cause, size, output=Distortion(math.exp(size)), weight=_LAST, is_gain=True),
        TORQUE_SIGN: lambda: Hypothesis(cause, torque=Distortion(-1.0)),
        OUTPUT_SIGN: lambda: Hypothesis(cause, output=Distortion(-1.0)),
        DELAY: lambda: Hypothesis(cause, size, delay_s=size * settings.interval_s),
        OUTPUT_OFFSET: lambda: Hypothesis(cause, size, output=Distortion(offset=size * math.sqrt(settings.lam0))),
        OUTPUT_STUCK: lambda: Hypothesis(cause, frozen=True),
    }
    return plain[cause]()


def _payload(model: AxisModel) -> Iterator[str]:
    """Causes for another payload, if it does not show in a monitored parameter."""
    if model.arm_inertia():
        yield INERTIA
    if model.carried_weight():
        yield LOAD


def _scale(model: AxisModel, name: str) -> float:
    return model.scales.get(name, abs(model.nominal[split_name(name)[0]]))


def _of_parameter(model: AxisModel, settings: Settings, name: str, size: float) -> Hypothesis:
    """Change of a parameter: times exp(size), or plus size times its scale if the nominal value is not positive."""
    base, inverse = split_name(name)
    if model.nominal[base] > 0:
        # The acceleration is proportional to the torque constant, and to the inverse of an inertia.
        is_gain = inverse or base == TORQUE_CONSTANT or _brakes_in_proportion(model, settings, base)
        return Hypothesis(name, size, factors={base: math.exp(-size if inverse else size)}, is_gain=is_gain)
    return Hypothesis(name, size, shifts={base: size * _scale(model, name)})


def _brakes_in_proportion(model: AxisModel, s: Settings, name: str) -> bool:
    """Whether the effect of a friction is proportional to it, as its torque is.

    It is not if this friction, and not the gain, determines for how long the predictor remembers.
    """
    if name not in chain(*friction_of(model.drive)):
        return False
    K, model = s.gain(len(model.drive.states)), replace(model, monitored=(), scales={}, bounds={})
    doubled = {**model.nominal, name: 2 * model.nominal[name]}
    before, after = (slowest_time_constant(m, K, s.interval_s) for m in (model, replace(model, nominal=doubled)))
    return after > before / math.sqrt(2)


def torque_unit(model: AxisModel, s: Settings) -> float:
    """The constant torque [N m] that moves the predicted output by sqrt(lam0) within a memory."""
    A, B, C = model.matrices()
    torque = B[:, [kind == TORQUE for kind in model.drive.inputs]].sum(axis=1, keepdims=True)
    K, mean = s.gain(len(A))[:, np.newaxis], model.drive.mean_state
    Ad, Bd = zero_order_hold(A, torque, s.interval_s)
    x, largest = np.zeros((len(A), 1)), 0.0
    for _ in range(round(s.memory)):
        x = Ad @ x + Bd
        e = (C @ x).item() / (s.interval_s if mean >= 0 else 1.0)
        x -= K * e
        if mean >= 0:
            x[mean] = 0.0
        largest = max(largest, abs(e))
    return math.sqrt(s.lam0) / largest


def _lost_torque(model: AxisModel, s: Settings, cause: str, size: float) -> Hypothesis:
    """Hypothesis that the measured torque is not the acting torque, which the predictor takes as random.

    The size of the acting torque is unknown; ``size`` is its effect on the variance of the innovations.
    """
    noise = math.sqrt(s.lam0 * (1 - _corrected(model, s)))
    K, lam = _random_torque(model, s.interval_s, noise, math.exp(size) * s.lam0)
    weight, still = (1.0, True) if cause == TORQUE_STUCK else (_LAST, False)
    return Hypothesis(cause, size, torque=Distortion(0.0), K=K, variance=lam / s.lam0, still=still, weight=weight)


def _corrected(model: AxisModel, s: Settings) -> float:
    """C K, the corrected share of an innovation; (1 - C K) lambda_0 is the variance of the output noise."""
    C = model.matrices()[2][0] / (s.interval_s if model.drive.mean_state >= 0 else 1.0)
    return float(min(C @ s.gain(len(C)), 0.99))


def _random_torque(model: AxisModel, interval_s: float, noise: float, lam: float) -> tuple[tuple[float, ...], float]:
    """Gain and innovation variance for the torque noise with which the variance is ``lam``; by bisection."""
    low, high = -12.0, 12.0
    K, found = filter_gain(model, interval_s, noise, noise)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        K, found = filter_gain(model, interval_s, math.exp(middle) * noise, noise)
        low, high = (middle, high) if found < lam else (low, middle)
    return tuple(float(k) for k in K), found


def _both(sizes: tuple[float, ...]) -> tuple[float, ...]:
    return (*(-size for size in reversed(sizes)), *sizes)


# --- Physical units: nominal value and unit of a cause, and conversion of sizes ---------------------------------------


class CauseQuantity(NamedTuple):
    """Nominal value of a cause, in ``unit``, and the conversion of a size of the bank to a change in that unit.

    ``step``: the change for a size of 1; NaN if sizes are logarithms of factors of ``nominal``; 0 if the cause has no
    size.
    """

    nominal: float
    unit: str
    step: float

    def change(self, size: float, sd: float) -> tuple[float, float]:
        """Change and its standard deviation, from a size and its standard deviation in the bank."""
        if self.step == 0:
            return math.nan, math.nan
        if math.isnan(self.step):
            return self.nominal * math.expm1(size), abs(self.nominal) * math.exp(size) * sd
        return self.step * size, self.step * sd

    def size(self, change: float) -> float:
        """Size of a change; NaN if the cause has no size, or if the change is impossible."""
        if self.step == 0:
            return math.nan
        if math.isnan(self.step):
            ratio = 1 + change / self.nominal
            return math.log(ratio) if ratio > 0 else math.nan
        return change / self.step


def causes_of(model: AxisModel) -> tuple[str, ...]:
    """All causes that a bank may name: the monitored parameters, another payload, and the faults of sensors."""
    return tuple(dict.fromkeys((*model.monitored, *_payload(model), *SENSOR_FAULTS)))


def quantity_of(model: AxisModel, settings: Settings, cause: str) -> CauseQuantity:
    """Quantity of a cause; monitored parameters have the units of theta.

    Raises:
        KeyError: there is no such cause.
    """
    if cause not in causes_of(model):
        raise KeyError(cause)
    if cause == DELAY:
        return CauseQuantity(model.nominal.get(DELAY, settings.delay_s), "s", settings.interval_s)
    if cause in model.monitored:
        i = model.monitored.index(cause)
        factor = model.nominal[split_name(cause)[0]] > 0
        step = math.nan if factor else _scale(model, cause)
        return CauseQuantity(float(model.theta0[i]), model.parameters[i].unit, step)
    if cause in (INERTIA, LOAD, TORQUE_SCALE, OUTPUT_SCALE, OUTPUT_NOISE):
        return CauseQuantity(1.0, "1", math.nan)
    if cause == TORQUE_OFFSET:
        return CauseQuantity(0.0, "N m", torque_unit(model, settings))
    if cause == OUTPUT_OFFSET:
        return CauseQuantity(0.0, "rad" if model.drive.output == "angle" else "rad/s", math.sqrt(settings.lam0))
    return CauseQuantity(0.0, "1", 0.0)
