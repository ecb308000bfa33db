"""Candidate changes: the monitored parameters up and down in several sizes, another payload, faults of the sensors."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
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
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DELAY, LOAD, OUTPUT_UNITS
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


class CandidateCause(NamedTuple):
    """A cause of which the bank has hypotheses, in several sizes."""

    quantity: CauseQuantity
    hypothesis: Callable[[float], Hypothesis]
    """Returns the hypothesis of a size"""
    sizes: tuple[float, ...] = (math.nan,)
    """Sizes of the candidates; NaN: the cause has no size"""


_RATIO = CauseQuantity(1.0, "1", math.nan)
_NO_SIZE = CauseQuantity(0.0, "1", 0.0)


def _both(sizes: tuple[float, ...]) -> tuple[float, ...]:
    return (*(-size for size in reversed(sizes)), *sizes)


def candidates(model: AxisModel, settings: Settings) -> tuple[Hypothesis, ...]:
    """All candidate changes of an axis."""
    causes = (candidate_cause(model, settings, name) for name in _in_order(model))
    return tuple(cause.hypothesis(size) for cause in causes for size in cause.sizes)


def _in_order(model: AxisModel) -> list[str]:
    """All causes in the order of their hypotheses, on which saved states depend."""
    names = [name for name in causes_of(model) if name != DELAY]
    names.insert(names.index(TORQUE_OFFSET), DELAY)
    return names


def causes_of(model: AxisModel) -> tuple[str, ...]:
    """All causes that a bank may name: the monitored parameters, another payload, and the faults of sensors."""
    payload = [INERTIA] if model.arm_inertia() else []
    payload += [LOAD] if model.carried_weight() else []
    return tuple(dict.fromkeys((*model.monitored, *payload, *SENSOR_FAULTS)))


def candidate_cause(model: AxisModel, settings: Settings, name: str) -> CandidateCause:
    """The cause with this name; a monitored parameter has the unit of its theta.

    Raises:
        KeyError: there is no such cause.
    """
    if name not in causes_of(model):
        raise KeyError(name)
    if name in model.monitored and name != DELAY:
        return _parameter(model, settings, name)
    if name in (INERTIA, LOAD):
        return CandidateCause(_RATIO, partial(_other_payload, model, name), _both(SIZES))
    return _sensor_fault(model, settings, name)


# --- A parameter, or the payload --------------------------------------------------------------------------------------


def _parameter(model: AxisModel, settings: Settings, name: str) -> CandidateCause:
    """Change of a parameter: times exp(size), or plus size times its scale if the nominal value is not positive."""
    i = model.monitored.index(name)
    base, inverse = split_name(name)
    nominal, unit = float(model.theta0[i]), model.parameters[i].unit

    def scaled(size: float) -> Hypothesis:
        # The acceleration is proportional to the torque constant, and to the inverse of an inertia.
        is_gain = inverse or base == TORQUE_CONSTANT or _brakes_in_proportion(model, settings, base)
        return Hypothesis(name, size, factors={base: math.exp(-size if inverse else size)}, is_gain=is_gain)

    if model.nominal[base] > 0:
        return CandidateCause(CauseQuantity(nominal, unit, math.nan), scaled, _both(SIZES))
    scale = model.scales.get(name, abs(model.nominal[base]))
    return CandidateCause(
        CauseQuantity(nominal, unit, scale),
        lambda size: Hypothesis(name, size, shifts={base: size * scale}),
        _both(SIZES),
    )


def _other_payload(model: AxisModel, name: str, size: float) -> Hypothesis:
    """Another payload, which shows in the weight, if the axis bears any, and in the inertia."""
    factors, share = dict.fromkeys(model.carried_weight(), math.exp(size)), _LOAD_INERTIA_SHARE
    if name == INERTIA:
        factors, share = {}, 1.0
    if (inertia := model.arm_inertia()) is not None:
        factors[inertia] = math.exp(share * size)
    return Hypothesis(name, size, factors=factors)


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


# --- Faults of the sensors --------------------------------------------------------------------------------------------


def _sensor_fault(model: AxisModel, s: Settings, name: str) -> CandidateCause:
    if name in (TORQUE_STUCK, TORQUE_LOST):
        lost = tuple(math.log(ratio) for ratio in _LOST)
        return CandidateCause(_NO_SIZE, partial(_lost_torque, model, s, name), lost)
    if name == TORQUE_OFFSET:
        step = torque_unit(model, s)
        return CandidateCause(
            CauseQuantity(0.0, "N m", step),
            lambda size: Hypothesis(name, size, torque=Distortion(offset=size * step)),
            _both(_OFFSETS),
        )
    angle, sd = model.drive.output == "angle", math.sqrt(s.lam0)
    return {
        TORQUE_SCALE: CandidateCause(
            _RATIO,
            lambda size: Hypothesis(name, size, torque=Distortion(math.exp(size)), is_gain=True),
            _both(SIZES),
        ),
        # A last resort: the scale of an encoder is fixed by design, and a change of it looks almost like one of kT.
        OUTPUT_SCALE: CandidateCause(
            _RATIO,
            lambda size: Hypothesis(name, size, output=Distortion(math.exp(size)), weight=_LAST, is_gain=True),
            _both(SIZES),
        ),
        TORQUE_SIGN: CandidateCause(_NO_SIZE, lambda _size: Hypothesis(name, torque=Distortion(-1.0))),
        OUTPUT_SIGN: CandidateCause(_NO_SIZE, lambda _size: Hypothesis(name, output=Distortion(-1.0))),
        DELAY: CandidateCause(
            CauseQuantity(model.nominal.get(DELAY, s.delay_s), "s", s.interval_s),
            lambda size: Hypothesis(name, size, delay_s=size * s.interval_s),
            _both(_DELAYS),
        ),
        # A predictor of the angle follows an offset of the angle.
        OUTPUT_OFFSET: CandidateCause(
            CauseQuantity(0.0, OUTPUT_UNITS[model.drive.output], sd),
            lambda size: Hypothesis(name, size, output=Distortion(offset=size * sd)),
            () if angle else _both(_OFFSETS),
        ),
        OUTPUT_STUCK: CandidateCause(_NO_SIZE, lambda _size: Hypothesis(name, frozen=True)),
        # Any change looks like noise at first, while the state of the predictor has not settled.
        OUTPUT_NOISE: CandidateCause(
            _RATIO,
            lambda size: Hypothesis(name, size, variance=math.exp(2 * size), weight=_LAST),
            tuple(math.log(ratio) for ratio in _NOISES),
        ),
    }[name]


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
