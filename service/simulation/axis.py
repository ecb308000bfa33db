"""A simulated axis: the drive, a soft position controller, a test signal, sensors with noise."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive import (
    COSINE,
    COULOMB,
    DELAY,
    SINE,
    TORQUE,
    AxisModel,
    Conditions,
    Follow,
    Gate,
    Operating,
    split_name,
)
from monitor_core.excitation import faulty, multisine
from monitor_core.modeling import SimulatedAxis
from service.config import NamedAxis, conditions_of, drive_of, given_values, needed, predictor_of
from service.config.drives import axis_model

PERIOD_S = 10.0
BAND_HZ = (0.0, 30.0)
RIPPLE = 0.4
"""Part of the configured torque noise that the drive really has; the rest is for what no model has."""

FOLLOW_S = 0.1
"""So often a drive follows its operating conditions."""

_SWING, _SWING_PERIOD_S = 2.0, 20.0  # rad, s


class Reading(NamedTuple):
    """Values of one sample that the controller sends."""

    torque: float  # N m
    motion: float  # rad or rad/s
    signals: tuple[float, ...] = ()  # further ones that the axis needs, in the order of the configuration


class ControlledAxis:
    """Position-controlled axis with the drive, the nominal values and the noise of a configured one.

    Args:
        axis: the configured axis.
        rng: for the test signal and the noise.
    """

    def __init__(self, axis: NamedAxis, rng: np.random.Generator) -> None:
        config = axis.config
        self.axis, self.interval_s = axis, config.sample_interval_s
        predictor = predictor_of(config)
        self._delay_s = predictor.torque_delay_s
        self._output, self._averaged = config.output, config.interval_mean
        self._rng = rng
        # With the angle among its states, whichever of angle and speed is sent.
        self._given = given_values(config)
        self._model = model = AxisModel(drive_of(config, "angle"), self._given, ())
        self._drive = SimulatedAxis(model.nominal, predictor.friction_speed_scale, drive=model.drive)
        self._motion = _motion_of(model, _lines_of_motion(self.interval_s))
        length, band = round(PERIOD_S / self.interval_s), _band(self.interval_s)
        self._test_signal = multisine(rng, length, self.interval_s, band, self._motion.torque_rms)
        self._ripple = RIPPLE * (predictor.torque_noise or 0.0)
        self._noise = predictor.output_noise or 0.0
        self._torque_before = self._angle_before = 0.0
        self._conditions = SimulatedConditions(axis) if conditions_of(axis) else None
        self._follows_every = max(1, round(FOLLOW_S / self.interval_s))

    def break_down(self, fault: Mapping[str, float]) -> None:
        """Multiply parameters by factors from now on: {"fm": 1.3, "1/Ja": 0.8}.

        They may be parameters of the drive, or drawn ones of which the drive has merged ones.  The delay of the torque
        is given in seconds instead of a factor.

        Raises:
            KeyError: the drive has no such parameter.
            ValueError: the drive cannot have such a value.
        """
        own = {name: factor for name, factor in fault.items() if name != DELAY or DELAY in self._given}
        changed = faulty({**self._model.nominal, **self._given}, own)
        named = {split_name(name)[0] for name in own}
        delay_s = fault.get(DELAY, self._delay_s) if DELAY not in own else self._delay_s
        if not 0 <= delay_s <= self.interval_s:
            raise ValueError(
                f"delay = {delay_s:g}: a torque acts from 0 to {self.interval_s:g} s after its sample"
            )
        given = {name: value for name, value in changed.items() if name in named or name in self._given}
        self._drive.set(AxisModel(self._model.drive, given, ()).nominal)
        self._given, self._delay_s = given, delay_s

    def sample(self, k: int, others: Mapping[str, float] = MappingProxyType({})) -> Reading:
        """Sample k: the measured and commanded values now; then the drive moves to the next one.

        ``others`` are the motions of the other axes of the robot as sent, by name.
        """
        signals = self._conditions.signals(k * self.interval_s, others) if self._conditions else ()
        if self._conditions and k % self._follows_every == 0:
            values = AxisModel(self._model.drive, self._given, ()).nominal
            self._drive.set(dict(self._conditions.followed(signals, values)))
        torque = self._command(k)
        reading = Reading(torque, self._moved() + self._noise * self._rng.standard_normal(), signals)
        self._move(torque + self._ripple * self._rng.standard_normal())
        return reading

    def _moved(self) -> float:
        """Measured motion: the angle, the speed, or its mean since the last sample."""
        if self._output == "angle":
            return self._drive.angle
        way, self._angle_before = self._drive.angle - self._angle_before, self._drive.angle
        return way / self.interval_s if self._averaged else self._drive.speed

    def _command(self, k: int) -> float:
        """PD control around a slow swing, and the test signal."""
        motion, angle = self._motion, self._drive.angle
        wanted = _SWING * math.sin(2 * math.pi * k * self.interval_s / _SWING_PERIOD_S)
        test = self._test_signal[k % len(self._test_signal)]
        held = motion.kp * (wanted - angle) - motion.kd * self._drive.speed + motion.holding(angle)
        return float(held + test)

    def _move(self, torque: float) -> None:
        """Move over one interval: the previous torque acts until the delay is over."""
        if self._delay_s > 0:
            self._drive.step(self._torque_before, self._delay_s)
        if self._delay_s < self.interval_s:
            self._drive.step(torque, self.interval_s - self._delay_s)
        self._torque_before = torque


def _band(interval_s: float) -> tuple[float, float]:
    """The band of the test signal, below the Nyquist frequency of slow samples."""
    return BAND_HZ[0], min(BAND_HZ[1], 0.4 / interval_s)


def _lines_of_motion(interval_s: float) -> Floats:
    """The frequencies of the test signal [rad/s]."""
    low, high = (round(end * PERIOD_S) for end in _band(interval_s))
    return np.asarray(2 * np.pi / PERIOD_S * np.arange(max(low, 1), high + 1), dtype=float)


# --- Its motion: controller and test signal from the frequency response of the drive, so for any drive ----------------


SPEED_RMS = 3.0
"""rad/s at the sensor, from the test signal alone: on the reference drive that takes 1.2 N m."""

_BANDWIDTH = 2.0  # rad/s: slow, so that the test signal moves the axis and not the controller
_RIGID = np.array([0.1, 0.2])  # rad/s: so slow that nothing bends


class Weight(NamedTuple):
    """The motor torque [N m] that holds a weight at angle zero, times cosine or sine of ``ratio`` * angle."""

    kind: int
    torque: float
    ratio: float


class Motion(NamedTuple):
    """``kp`` [N m/rad] and ``kd`` [N m s/rad] of the position controller, ``torque_rms`` [N m] of the test signal."""

    kp: float
    kd: float
    torque_rms: float
    weights: tuple[Weight, ...] = ()

    def holding(self, angle: float) -> float:
        """Torque [N m] that balances all weights at this angle [rad]."""
        return sum(
            w.torque * (math.cos if w.kind == COSINE else math.sin)(w.ratio * angle) for w in self.weights
        )


def _motion_of(model: AxisModel, lines: Floats) -> Motion:
    """The motion of a drive whose output is the angle.

    Args:
        model: the drive with its nominal values.
        lines: angular frequencies of the test signal [rad/s] (L,).
    """
    low, high = _stiffness(model, _RIGID)[0].real
    inertia = float(abs(low - high) / (_RIGID[1] ** 2 - _RIGID[0] ** 2))
    kp, kd = inertia * _BANDWIDTH**2, inertia * _BANDWIDTH
    torque, others = _stiffness(model, lines)
    # Of fc sign(w), at a speed of random phases and SPEED_RMS, the part sqrt(2/pi) fc / SPEED_RMS follows the speed.
    friction = np.abs(_of_kind(model, others, COULOMB)) * math.sqrt(2 / math.pi) / SPEED_RMS
    closed = torque + kp + 1j * lines * (kd + friction)
    speed = np.sqrt(np.mean(np.abs(lines / closed) ** 2))  # rms at a torque of 1 N m rms
    return Motion(kp, kd, float(SPEED_RMS / speed), tuple(_weights(model)))


def _stiffness(model: AxisModel, omega: Floats) -> tuple[Floats, Floats]:
    """Torque over angle (L,) and the torque (L, m) that acts like each input at 1; both complex."""
    A, B, C = model.matrices()
    s = 1j * omega[:, np.newaxis, np.newaxis] * np.eye(len(A))
    inputs = np.broadcast_to(B, (len(omega), *B.shape)).astype(complex)
    response = (C @ np.linalg.solve(s - A, inputs))[:, 0, :]
    torque = _of_kind(model, response, TORQUE)
    return 1 / torque, response / torque[:, np.newaxis]


def _of_kind(model: AxisModel, by_input: Floats, kind: int) -> Floats:
    return np.asarray(by_input[:, [k == kind for k in model.drive.inputs]].sum(axis=1))


def _weights(model: AxisModel) -> Sequence[Weight]:
    like_torque = _stiffness(model, _RIGID)[1][0].real
    ratio = model.drive.matrix("ratio", model.nominal)[:, 0]
    return [
        Weight(kind, -float(like_torque[i]), float(ratio[i]))
        for i, kind in enumerate(model.drive.inputs)
        if kind in (COSINE, SINE)
    ]


# --- Operating conditions: auxiliary signals, and their effect on the drive -------------------------------------------


SIGNAL_PERIOD_S = 60.0
"""In which a signal that is followed swings through its range once."""
_SIGNAL_SWING = 0.45
"""Of the width of its range, to both sides of the middle."""
_BACK = {"cos": math.acos, "sin": math.asin, "square": math.sqrt}


class SimulatedConditions:
    """Signals that keep the gates of an axis open, and parameters that follow them.

    A signal of another axis is the motion that this axis sends.  A signal of a schedule swings through its range,
    others are constant.
    """

    def __init__(self, axis: NamedAxis) -> None:
        conditions = conditions_of(axis)
        self._sources = needed(axis)
        self._swings = [_swing(source.name, conditions) for source in self._sources]
        self._model = axis_model(axis.config)
        self._operating = Operating(self._model, replace(conditions, gates=(), min_speed=0.0))

    def signals(self, time_s: float, others: Mapping[str, float]) -> tuple[float, ...]:
        """The signals at that time; ``others`` are the motions of the other axes of the robot as sent, by name."""
        phase = math.sin(2 * math.pi * time_s / SIGNAL_PERIOD_S)
        return tuple(
            middle + swing * phase
            if source.axis is None
            else source.factor * others.get(source.axis, math.nan) + source.offset
            for source, (middle, swing) in zip(self._sources, self._swings, strict=True)
        )

    def followed(
        self, signals: tuple[float, ...], values: Mapping[str, float]
    ) -> Iterator[tuple[str, float]]:
        """The parameters that follow the signals, with these values at the references."""
        shift, _ = self._operating.take(np.zeros(1, np.int64), np.zeros(1), np.array([signals]))
        for name, moved, unit in zip(self._model.monitored, shift[0], self._model.unit, strict=True):
            base, inverse = split_name(name)
            if math.isfinite(moved) and moved != 0 and base in values:
                value = (1 / values[base] if inverse else values[base]) + float(moved * unit)
                yield base, 1 / value if inverse else value


def _swing(name: str, conditions: Conditions) -> tuple[float, float]:
    gates = [gate for gate in conditions.gates if gate.signal == name]
    follows = [follow for follow in conditions.follows if follow.term.signal == name]
    if gates:
        candidates = list(_candidates(gates))
        fitting = (v for v in candidates if all(gate.open(np.array([v])).all() for gate in gates))
        return next(fitting, candidates[0]), 0.0
    first = follows[0]
    if not first.term.function and math.isfinite(first.high - first.low):
        return (first.low + first.high) / 2, _SIGNAL_SWING * (first.high - first.low)
    return _at_reference(first), 0.0


def _candidates(gates: list[Gate]) -> Iterator[float]:
    for gate in gates:
        yield from gate.equals
    above, below = max(g.above for g in gates), min(g.below for g in gates)
    if math.isfinite(above) or math.isfinite(below):
        span = 2.0 if math.isinf(above) or math.isinf(below) else below - above
        yield above + span / 2 if math.isfinite(above) else below - span / 2
    yield 0.0


def _at_reference(follow: Follow) -> float:
    back = _BACK.get(follow.term.function)
    try:
        return back(follow.reference) if back else follow.reference
    except ValueError:  # a mean of a square, or what is no cosine at all
        return 0.0
