"""A simulated axis: the drive, a compliant position controller, a test signal, sensors with noise."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import DELAY, LOAD, AxisModel, Conditions, Gate, NominalSchedule, Operating, split_name
from monitor_core.excitation import Plant, faulty, multisine
from monitor_core.modeling import SimulatedAxis
from monitor_core.samples import SampleBlock
from service.config import NamedAxis, conditions_of, drive_of, given_values, needed, predictor_of
from service.config.axis_settings import AxisError, check_known
from service.config.conditions import weight_of
from service.config.drives import axis_model, not_identified
from service.ingest.samples.motion_derivatives import derivative_of

PERIOD_S = 10.0
BAND_HZ = (0.0, 30.0)
RIPPLE = 0.4
"""Share of the configured torque noise that the simulated drive has; the rest allows for errors of the model."""

FOLLOW_S = 0.1
"""Interval at which the parameters of a drive are updated to its operating conditions [s]."""

_SWING, _SWING_PERIOD_S = 2.0, 20.0  # rad, s


class SimulatedSample(NamedTuple):
    """Values of one sample, as the controller sends them."""

    torque: float  # N m
    motion: float  # rad or rad/s
    signals: tuple[float, ...] = ()  # further ones that the axis needs, in the order of the configuration


class ControlledAxis:
    """Position-controlled axis with the drive, the nominal values and the noise of a configured one.

    Args:
        axis: the configured axis.
        rng: random numbers for the test signal and the noise.
    """

    def __init__(self, axis: NamedAxis, rng: np.random.Generator) -> None:
        config = axis.config
        self.axis, self.interval_s = axis, config.sample_interval_s
        predictor = predictor_of(config)
        self._delay_s = predictor.torque_delay_s
        self._output, self._averaged = config.output, config.interval_mean
        self._rng = rng
        # The angle is always among the states, whether angle or speed is sent.
        self._given = given_values(config)
        if not_identified(config):
            check_known(axis)
        self._model = model = AxisModel(drive_of(config, "angle"), self._given, ())
        self._drive = SimulatedAxis(model.nominal, predictor.friction_speed_scale, drive=model.drive)
        self._plant = Plant(model.drive, model.nominal, self.interval_s, predictor.friction_speed_scale)
        J = self._plant.inertia
        self._kp, self._kd = J * _BANDWIDTH**2, J * _BANDWIDTH
        self._test_signal = _test_signal(self._plant, self._kp, self._kd, rng)
        self._ripple = RIPPLE * (predictor.torque_noise or 0.0)
        self._noise = predictor.output_noise or 0.0
        self._torque_before = self._angle_before = 0.0
        self._conditions = SimulatedConditions(axis) if conditions_of(axis) else None
        self._follows_every = max(1, round(FOLLOW_S / self.interval_s))

    def break_down(self, fault: Mapping[str, float]) -> None:
        """Multiply parameters by these factors from now on: {"fm": 1.3, "1/Ja": 0.8}.

        They may be parameters of the drive, or drawn ones that the drive contains in merged form.  The delay of the
        torque is given in seconds instead of a factor.

        Raises:
            KeyError: the drive has no such parameter.
            ValueError: the drive cannot have such a value.
        """
        own = {name: factor for name, factor in fault.items() if name != DELAY or DELAY in self._given}
        weighs = self._conditions is not None and self._conditions.weighs and LOAD not in self._given
        load = own.pop(LOAD, None) if weighs else None
        changed = faulty({**self._model.nominal, **self._given}, own)
        named = {split_name(name)[0] for name in own}
        delay_s = fault.get(DELAY, self._delay_s) if DELAY not in own else self._delay_s
        if not 0 <= delay_s <= self.interval_s:
            raise ValueError(f"delay = {delay_s:g}: a torque acts from 0 to {self.interval_s:g} s after its sample")
        given = {name: value for name, value in changed.items() if name in named or name in self._given}
        self._drive.set(AxisModel(self._model.drive, given, ()).nominal)
        self._given, self._delay_s = given, delay_s
        if self._conditions is not None and load is not None:
            self._conditions.load = load

    def sample(self, k: int, others: Mapping[str, float] = MappingProxyType({})) -> SimulatedSample:
        """Sample k: the present measured and commanded values; then the drive advances to the next sample.

        ``others`` are the motions of the other axes of the robot as sent, by name.
        """
        signals = self._conditions.signals(k * self.interval_s, others) if self._conditions else ()
        if self._conditions and k % self._follows_every == 0:
            values = AxisModel(self._model.drive, self._given, ()).nominal
            motion = self._drive.angle if self._output == "angle" else self._drive.speed
            followed = self._conditions.followed(k * self.interval_s, motion, signals, values)
            self._drive.set(dict(followed))
        torque = self._command(k)
        reading = SimulatedSample(torque, self._moved() + self._noise * self._rng.standard_normal(), signals)
        self._move(torque + self._ripple * self._rng.standard_normal())
        return reading

    def _moved(self) -> float:
        """Measured motion: the angle, the speed, or the mean speed since the last sample."""
        if self._output == "angle":
            return self._drive.angle
        way, self._angle_before = self._drive.angle - self._angle_before, self._drive.angle
        return way / self.interval_s if self._averaged else self._drive.speed

    def _command(self, k: int) -> float:
        """PD control around a slow sinusoidal motion, plus the test signal."""
        angle = self._drive.angle
        wanted = _SWING * math.sin(2 * math.pi * k * self.interval_s / _SWING_PERIOD_S)
        held = self._kp * (wanted - angle) - self._kd * self._drive.speed
        if self._plant.bears_weight:
            held += float(self._plant.countered(np.array([angle]), np.zeros(1))[0])
        return float(held + self._test_signal[k % len(self._test_signal)])

    def _move(self, torque: float) -> None:
        """Advance by one interval; the previous torque acts until the delay is over."""
        if self._delay_s > 0:
            self._drive.step(self._torque_before, self._delay_s)
        if self._delay_s < self.interval_s:
            self._drive.step(torque, self.interval_s - self._delay_s)
        self._torque_before = torque


# --- The test signal: its size follows from the frequency response of the drive, so it moves any drive as fast --------


SPEED_RMS = 3.0
"""Speed [rad/s] at the sensor from the test signal alone; on the reference drive it takes 1.2 N m."""

_BANDWIDTH = 2.0  # rad/s: slow, so that the test signal moves the axis and not the controller
_FAST = 1e9  # rad/s: Coulomb friction is complete


def _test_signal(plant: Plant, kp: float, kd: float, rng: np.random.Generator) -> Floats:
    """One period of the torque [N m]; its frequencies are below the Nyquist frequency of slow samples."""
    h = plant.interval_s
    low, high = BAND_HZ[0], min(BAND_HZ[1], 0.4 / h)
    lines = np.arange(max(round(low * PERIOD_S), 1), round(high * PERIOD_S) + 1) / PERIOD_S
    size = SPEED_RMS / _speed_rms(plant, kp, kd, lines)
    return multisine(rng, round(PERIOD_S / h), h, (low, high), size)


def _speed_rms(plant: Plant, kp: float, kd: float, frequency_hz: Floats) -> float:
    """Speed [rad/s rms] of the controlled drive at a torque of 1 N m rms on these lines (L,)."""
    s = 2j * np.pi * frequency_hz
    # The response is that of the held torque.
    held = -np.expm1(-s * plant.interval_s) / (s * plant.interval_s)
    angle = plant.response(frequency_hz)[0] / held
    forwards, backwards = plant.countered(np.zeros(2), np.array([_FAST, -_FAST]))
    # Of fc sign(w) at a random speed with SPEED_RMS, the part sqrt(2/pi) fc / SPEED_RMS is proportional to the speed.
    friction = (forwards - backwards) / 2 * math.sqrt(2 / math.pi) / SPEED_RMS
    speed = s * angle / (1 + (kp + s * (kd + friction)) * angle)
    return float(np.sqrt(np.mean(np.abs(speed) ** 2)))


# --- Operating conditions: auxiliary signals, and their effect on the drive -------------------------------------------


SIGNAL_PERIOD_S = 60.0
"""Period in which a signal of a schedule moves through its range once [s]."""
_SIGNAL_SWING = 0.45
"""Amplitude as a share of the width of the range, to either side of its middle."""
_BACK = {"cos": math.acos, "sin": math.asin, "square": math.sqrt}


class SimulatedConditions:
    """Signals that keep the gates of an axis open, and parameters that follow them; the thermal state starts cold.

    A signal of another axis is the motion that the other axis sends.  Signals of schedules oscillate over their range;
    other signals are constant.
    """

    def __init__(self, axis: NamedAxis) -> None:
        conditions = conditions_of(axis)
        self._sources = needed(axis)
        if own := [s.name for s in self._sources if s.acceleration and s.axis == axis.config.name]:
            raise AxisError(
                f"{axis.id}: its torque offset follows {own[0]}, the acceleration of the axis itself, which the"
                " simulation has only after the torque: simulate a configuration in which its inertia is constant"
            )
        self._swings = [_swing(source.name, conditions) for source in self._sources]
        self._derivatives = tuple(derivative_of(source, axis.config.sample_interval_s) for source in self._sources)
        self._model = axis_model(axis.config)
        thermal = conditions.thermal and replace(conditions.thermal, start="cold")
        plain = replace(conditions, gates=(), min_speed=0.0, thermal=thermal)
        self._operating = Operating(self._model, plain)
        self._weight = weight_of(axis.config)
        self.load = 1.0
        """Ratio of the acting weight to the nominal one"""

    @property
    def weighs(self) -> bool:
        """Whether a weight that depends on the pose acts on the axis."""
        return bool(self._weight)

    def signals(self, time_s: float, others: Mapping[str, float]) -> tuple[float, ...]:
        """The signals at a time; ``others``: motions of the other axes of the robot as sent, by name."""
        phase = math.sin(2 * math.pi * time_s / SIGNAL_PERIOD_S)
        values = list[float]()
        each = zip(self._sources, self._swings, self._derivatives, strict=True)
        for source, (middle, swing), derivative in each:
            value = middle + swing * phase
            if source.axis is not None:
                value = source.factor * others.get(source.axis, math.nan) + source.offset
            if derivative is not None:
                now_us = np.array([1e6 * time_s])
                value = float(derivative.take(np.array([value]), now_us, np.ones(1, np.int64), now_us)[0])
            values.append(value)
        return tuple(values)

    def followed(
        self, time_s: float, motion: float, signals: tuple[float, ...], values: Mapping[str, float]
    ) -> Iterator[tuple[str, float]]:
        """The parameters that follow signals and heat, at a time; ``values``: all parameters at the references."""
        t_us, row = np.array([round(time_s * 1e6)], np.int64), np.array([signals], np.float64)
        block = SampleBlock(t_us, np.zeros(1), np.array([motion]), signals=row)
        now = self._operating.conditioned(block)
        if now.weight is not None and math.isfinite(now.weight[0]):
            offset, nominal = self._weight[0].parameter, sum(v.slope * v.reference for v in self._weight)
            yield offset, values[offset] - nominal + self.load * float(now.weight[0])
        shift = np.zeros((1, 0)) if now.shift is None else now.shift
        for name, moved in zip(self._model.monitored, shift[0], strict=True):
            base, inverse = split_name(name)
            if math.isfinite(moved) and moved != 0 and base in values:
                value = (1 / values[base] if inverse else values[base]) + float(moved)
                yield base, 1 / value if inverse else value


def _swing(name: str, conditions: Conditions) -> tuple[float, float]:
    gates = [gate for gate in conditions.gates if gate.signal == name]
    every = (*conditions.schedules, *conditions.weight)
    follows = [follow for follow in every if name in follow.term.signals]
    if gates:
        candidates = list(_candidates(gates))
        fitting = (v for v in candidates if all(gate.open(np.array([v])).all() for gate in gates))
        return next(fitting, candidates[0]), 0.0
    first = follows[0]
    if first.term.is_signal and math.isfinite(first.high - first.low):
        return (first.low + first.high) / 2, _SIGNAL_SWING * (first.high - first.low)
    return _at_reference(first, name), 0.0


def _candidates(gates: list[Gate]) -> Iterator[float]:
    for gate in gates:
        yield from gate.equals
    above, below = max(g.above for g in gates), min(g.below for g in gates)
    if math.isfinite(above) or math.isfinite(below):
        span = 2.0 if math.isinf(above) or math.isinf(below) else below - above
        yield above + span / 2 if math.isfinite(above) else below - span / 2
    yield 0.0


def _at_reference(follow: NominalSchedule, name: str) -> float:
    """The value of a signal at which the term equals its reference, with the other signals of a sum at zero."""
    factor = follow.term.factors[0]
    if len(follow.term.factors) > 1 or factor.addends[0][1] != name:
        return 0.0
    sign, back = factor.addends[0][0], _BACK.get(factor.function)
    try:
        return sign * back(follow.reference) if back else follow.reference
    except ValueError:  # a mean of a square, or what is no cosine at all
        return 0.0
