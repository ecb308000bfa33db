"""An axis that is not what the monitor's model says: five masses in a position loop, picking and placing, warming up.

Beside the masses that a model of three does not have: friction with a Stribeck part and another law than the monitor's,
ripple of the torque, a torque disturbance that is not white, an encoder of 16 bit, and viscous friction that falls by a
third while the motor warms up by 20 K.  The drive itself measures finer than what it sends, controls at 2 kHz, and
sends its torque as the mean over each interval.

And the monitor that watches it: what it raises, and how it names what breaks.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.operating_conditions import Conditions, Operating
from monitor_core.kernel.compile import entry
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.standard_drives import five_mass
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.naming import alarm_versions
from tests.core.plants import Moves, motion, shortest_s

INTERVAL_S = 0.005
SUBSTEPS = 10
"""Of an interval: the drive controls, and friction is held, for 0.5 ms."""
BANDWIDTH = 2 * np.pi * 5.0
INTEGRAL_S = 0.3
"""Of the speed controller."""
R = 1 / 118

TORQUE_RMS = 2.2
"""N m, of the plant with the values below: what friction and disturbance are given in parts of."""
COULOMB, STRIBECK, RIPPLE, DISTURBANCE = 0.30, 0.15, 0.02, 0.05
PER_TURN = 6.0
DISTURBANCE_S = 0.25
"""Time constant of the disturbance."""
STRIBECK_SPEED, SLIDING_SPEED = 2.0, 0.2
"""rad/s: where the Stribeck part has fallen to 1/e, and where friction has its full size."""
STEP = 2 * np.pi / 2**16
"""Of the encoder, rad."""
WARMER, COLD = 20.0, 20.0
"""K by which the motor warms up, and its temperature in the morning, degrees."""
THIRD = np.log(1.5)
"""Viscous friction falls like exp(-THIRD (T - COLD) / WARMER): by a third."""

SPEED, ACCELERATION, DISTANCE = 50.0, 150.0, (8.0, 50.0)
"""Of the motions: the largest speed and acceleration of the fastest, rad/s and rad/s^2, and how far they go, rad."""
SLOWEST, DWELL_S = 0.5, (0.2, 1.0)
"""Speed and acceleration of the slowest over those of the fastest, and how long the axis stands between them."""
_RANGE = 60.0
"""rad, to either side of zero."""


def _five_masses() -> dict[str, float]:
    """On the motor's side as masses, springs and dampers of robot arms are; on the arm's side in the drive."""
    J, k, d = (8e-3, 12e-3, 4.6e-3, 2.4e-3), (28.0, 45.0, 38.0, 12.0), (0.05, 0.04, 0.02, 0.01)
    behind = {f"{x}{i}": v / R**2 for x, values in zip("Jkd", (J, k, d), strict=True) for i, v in enumerate(values, 1)}
    return {"Jm": 5.9e-3, **behind, "fm": 0.06, "fc": COULOMB * TORQUE_RMS, "tau0": 0.0, "kT": 1.0, "r": R}


@dataclass(frozen=True)
class Truth:
    """What a plant is like; torques in N m at the motor, temperatures and times in K and s."""

    values: Mapping[str, float]
    stribeck: float = STRIBECK * TORQUE_RMS
    ripple: float = RIPPLE
    disturbance: float = DISTURBANCE * TORQUE_RMS
    warming_s: float = 1200.0


NOMINAL = Truth(_five_masses())


def redrawn(rng: np.random.Generator, by: float = 0.2) -> Truth:
    """All values by up to so much more or less; gear ratio and torque constant are what the controller knows."""
    values = {name: v if name in ("kT", "r") else v * rng.uniform(1 - by, 1 + by) for name, v in NOMINAL.values.items()}
    others = {
        name: getattr(NOMINAL, name) * rng.uniform(1 - by, 1 + by) for name in ("stribeck", "ripple", "disturbance")
    }
    return replace(NOMINAL, values=values, **others)


class Block(NamedTuple):
    """Samples in a row: times, torque as the drive reports it, angle and temperature as they are sent (N,)."""

    t_us: NDArray[np.int64]
    u: Floats
    y: Floats
    temperature: Floats


class MismatchPlant:
    """The plant in time.  Its motion, disturbance and phase of the ripple come from ``rng``."""

    def __init__(self, truth: Truth, rng: np.random.Generator) -> None:
        self._truth, self._rng = truth, rng
        model = AxisModel(five_mass("angle"), {**truth.values, "fc": 0.0, "tau0": 0.0}, ())
        A, B, C = model.matrices()
        d = model.balance()
        b = B[:, [kind == TORQUE for kind in model.drive.inputs]] / truth.values["kT"]
        A, b = A / d[:, np.newaxis] * d, b / d[:, np.newaxis]
        self._Ad, Bd = zero_order_hold(A, b, INTERVAL_S / SUBSTEPS)
        self._Bd = np.ascontiguousarray(Bd[:, 0])
        self._angle = np.ascontiguousarray(C[0] * d)
        self._speed = np.ascontiguousarray(self._angle @ A)
        inertia = truth.values["Jm"] + R**2 * sum(truth.values[f"J{i}"] for i in range(1, 5))
        self._gains = np.array([BANDWIDTH / np.sqrt(2), inertia * BANDWIDTH * np.sqrt(2), inertia])
        self._x = np.zeros(len(A))
        self._held = np.zeros(2)  # integral of the controller, disturbance
        self._phase = rng.uniform(0, 2 * np.pi)
        self._moves, self._at = Moves(self._next_move), 0

    def take(
        self,
        seconds: float,
        fault: Mapping[str, float] | None = None,
        test: Floats | None = None,
        push: float = 0.0,
    ) -> Block:
        """The next samples; meanwhile kT, fc and fm have so many times their values, as ``fault`` says.

        ``test`` (N,) is a torque that is added to the controller's [N m], ``push`` one from outside.
        """
        truth, N = self._truth, round(seconds / INTERVAL_S)
        broken = {**dict.fromkeys(("kT", "fc", "fm"), 1.0), **(fault or {})}
        k = self._at + np.arange(N)
        t = np.asarray(k * INTERVAL_S, np.float64)
        warm = COLD + WARMER * (1 - np.exp(-t / truth.warming_s))
        healthy = np.exp(-THIRD * (warm - COLD) / WARMER)
        viscous = np.asarray(truth.values["fm"] * (broken["fm"] * healthy - 1), np.float64)
        friction = np.array([truth.values["fc"] * broken["fc"], truth.stribeck, truth.values["tau0"] + push])
        u, y = self._moved(viscous, friction, broken["kT"], test)
        return Block(np.round(k * INTERVAL_S * 1e6).astype(np.int64), u, np.round(y / STEP) * STEP, np.round(warm, 1))

    def _moved(self, viscous: Floats, friction: Floats, kT: float, test: Floats | None = None) -> tuple[Floats, Floats]:
        """Torque and angle of the next samples (N,); ``viscous`` (N,) is what is added to fm.

        ``friction`` is fc, the Stribeck part and the offset; ``kT`` a factor.
        """
        truth, N = self._truth, len(viscous)
        t = np.asarray((self._at + np.arange(N)) * INTERVAL_S, np.float64)
        moves = self._moves.between(float(t[0]), float(t[-1]) + INTERVAL_S)
        u, y = np.empty(N), np.empty(N)
        _simulate(
            self._Ad, self._Bd, self._angle, self._speed, self._gains, moves, t, viscous, friction,
            kT * truth.values["kT"], truth.ripple, self._phase, truth.disturbance,
            self._rng.standard_normal(N), np.zeros(N) if test is None else test, self._held, self._x, u, y,
        )  # fmt: skip
        self._at += N
        return u, y

    def _next_move(self, at: float) -> tuple[float, float, float]:
        rng, distance = self._rng, self._rng.uniform(*DISTANCE)
        forth = at + distance < _RANGE and (rng.random() < 0.5 or at - distance < -_RANGE)
        pace = rng.uniform(SLOWEST, 1.0)
        duration_s = shortest_s(distance, pace * SPEED, pace * ACCELERATION)
        return at + distance if forth else at - distance, duration_s, rng.uniform(*DWELL_S)


@entry
def _simulate(
    Ad: Floats,
    Bd: Floats,
    angle: Floats,
    speed: Floats,
    gains: Floats,
    moves: Floats,
    t: Floats,
    viscous: Floats,
    friction: Floats,
    kT: float,
    ripple: float,
    phase: float,
    disturbance: float,
    noise: Floats,
    test: Floats,
    held: Floats,
    x: Floats,
    u: Floats,
    y: Floats,
) -> None:
    """Cascaded control with feedforward along minimum-jerk moves; ``held`` (2,) and ``x`` (n,) go on."""
    n, h, move = x.size, INTERVAL_S / SUBSTEPS, 0
    a = np.exp(-INTERVAL_S / DISTURBANCE_S)
    w = np.zeros(n)
    for k in range(t.size):
        held[1] = a * held[1] + np.sqrt(1 - a * a) * disturbance * noise[k]
        total, q = 0.0, 0.0
        for j in range(n):
            q += angle[j] * x[j]
        y[k] = q
        for part in range(SUBSTEPS):
            now = t[k] + part * h
            while move + 1 < moves.shape[0] and moves[move + 1, 0] <= now:
                move += 1
            wanted, wanted_speed, acceleration = motion(moves, move, now)
            q, v = 0.0, 0.0
            for j in range(n):
                q += angle[j] * x[j]
                v += speed[j] * x[j]
            off = gains[0] * (wanted - q) + wanted_speed - v
            held[0] += gains[1] * h / INTEGRAL_S * off
            torque = gains[1] * off + held[0] + gains[2] * acceleration + test[k]
            total += torque
            rubbing = (friction[0] + friction[1] * np.exp(-((v / STRIBECK_SPEED) ** 2))) * np.tanh(v / SLIDING_SPEED)
            acting = kT * torque * (1 + ripple * np.sqrt(2.0) * np.sin(PER_TURN * q + phase))
            acting += held[1] + friction[2] - rubbing - viscous[k] * v
            for i in range(n):
                moved = Bd[i] * acting
                for j in range(n):
                    moved += Ad[i, j] * x[j]
                w[i] = moved
            for i in range(n):
                x[i] = w[i]
        u[k] = total / SUBSTEPS


def true_size(truth: Truth, name: str, factor: float, kT: float, speed_scale: float, warmer: float = WARMER) -> float:
    """What a change of the plant is in the unit of the monitor's parameter.

    It is another share of that than of the plant's value.  The monitor's Coulomb friction holds the Stribeck part, too,
    and has another dependence on speed: what counts is the torque that both have, on average.  Viscous friction has
    fallen by then.

    Args:
        truth: of the plant.
        name: of the parameter.
        factor: by which it changes.
        kT: nominal value of the monitor's.
        speed_scale: of the monitor's Coulomb friction, rad/s.
        warmer: how much the motor has warmed up, K.
    """
    change = truth.values[name] * (factor - 1)
    if name == "fm":
        return change * float(np.exp(-THIRD * warmer / WARMER))
    if name == "kT":
        return change * kT
    y = MismatchPlant(truth, np.random.default_rng(1)).take(120.0).y
    v = np.convolve(np.gradient(y, INTERVAL_S), np.full(5, 0.2), "same")
    model = np.tanh(v / speed_scale)
    return change * float(np.sum(np.tanh(v / SLIDING_SPEED) * model) / np.sum(model**2))


FAULTS: Mapping[str, tuple[float, float]] = {"kT": (1.2, 60.0), "fc": (1.3, 60.0), "fm": (1.5, 300.0)}
"""Factor, and seconds of motion within which it is to be named."""
MOVING = 0.5
"""rad/s, a hundredth of the largest speed: slower, the axis stands."""


class FaultAlarm(NamedTuple):
    """An alarm, with seconds from the beginning of what was watched; ``named_s`` is infinite before it is named."""

    parameter: str
    direction: str
    raised_s: float
    named_s: float
    size: float
    """In sizes of the parameter; NaN: not known"""
    size_sd: float
    first: str

    def holds(self, true: float) -> bool:
        """Whether the stated 90 % interval holds this true size."""
        return abs(self.size - true) < 1.645 * self.size_sd


@dataclass
class Watch:
    """The monitor of an axis as configured; it can be copied."""

    model: AxisModel
    settings: Settings
    conditions: Conditions
    monitor: AxisMonitor = field(init=False)

    def __post_init__(self) -> None:
        self.monitor = AxisMonitor(self.model, self.settings)

    def copy(self) -> Watch:
        other = Watch(self.model, self.settings, self.conditions)
        other.monitor.from_arrays(self.monitor.to_arrays())
        return other

    def take(self, block: Block) -> tuple[list[Alarm], Floats]:
        """What it raises or changes; and how far theta is off, in sizes (N, p)."""
        temperature = block.temperature[:, np.newaxis]
        shift, gate = Operating(self.model, self.conditions).take(block.t_us, block.y, temperature)
        episodes, trace = alarm_versions(self.monitor, SampleBlock(block.t_us, block.u, block.y, shift, gate))
        return episodes, (trace.theta - self.model.theta0 - shift) / self.model.scale


def after_fault(plant: MismatchPlant, watch: Watch, fault: Mapping[str, float], seconds: float) -> FaultAlarm | None:
    """What the first named alarm says when the plant breaks now; None: there is none in so many seconds of motion.

    Plant and monitor stay as they are.
    """
    plant, watch, start_us = copy.deepcopy(plant), watch.copy(), 0
    moved_s, taken_s = 0.0, 0.0
    while moved_s < seconds:
        block = plant.take(1.0, fault)
        start_us = start_us or int(block.t_us[0])
        taken_s += 1.0
        for e in watch.take(block)[0]:
            if e.stage == "named":
                return alarm_of(e, watch.model, start_us, taken_s)
        moved_s += float(np.mean(np.abs(np.diff(block.y)) > MOVING * INTERVAL_S))
    return None


def alarm_of(e: Alarm, model: AxisModel, start_us: int, named_s: float) -> FaultAlarm:
    scale = float(model.scale[model.monitored.index(e.parameter)])
    size, size_sd = (np.nan if value is None else value / scale for value in (e.size, e.size_sd))
    return FaultAlarm(e.parameter, e.direction, (e.raised_us - start_us) * 1e-6, named_s, size, size_sd, e.first[0])


def right(name: str, alarm: FaultAlarm | None) -> bool:
    """Whether it names an increase of that parameter."""
    return alarm is not None and (alarm.parameter, alarm.direction) == (name, "up")
