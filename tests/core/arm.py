"""A two-axis arm in a vertical plane that carries a payload: shoulder and elbow, each richer than its monitor's model.

Rigid links, M(q) q'' + C(q, q') + g(q, payload) = torque of the gears; elastic gears; at each motor viscous and Coulomb
friction, a Stribeck part, ripple of the torque and a disturbance that is not white.  Position control follows planned
motions of both axes at once.  Angles are counted from the horizontal, that of the elbow from the upper arm.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import entry
from tests.core.plants import Moves, motion, redrawn_fields, shortest_s

INTERVAL_S = 0.005
SUBSTEPS = 20
"""Of an interval: the drives control, and friction is held, for 0.25 ms."""
R = 1 / 100
"""Arm angle over motor angle, of both axes."""
AXES = ("shoulder", "elbow")
STEP = 2 * np.pi / 2**16
"""Of the encoders, rad of the motor."""
GRAVITY = 9.81
DISTURBANCE_S = 0.25
"""Time constant of the disturbance."""
STRIBECK_SPEED, SLIDING_SPEED = 5.0, 1.0
"""rad/s: where the Stribeck part has fallen to 1/e, and where friction has its full size."""
PER_TURN = 6.0
BANDWIDTH = 2 * np.pi * 4.0
INTEGRAL_S = 0.3
POSES = ((-0.3, 1.6), (-2.2, 0.2))
"""rad, of shoulder and elbow."""
SPEED, ACCELERATION, SLOWEST = 1.2, 2.0, 0.4
"""Of the fastest motions, rad/s and rad/s^2, and of the slowest over those."""
DWELL_S = (0.0, 0.3)


@dataclass(frozen=True)
class ArmTruth:
    """What an arm is like: SI units; those of the motors at the motor, of shoulder and elbow."""

    masses: tuple[float, float] = (12.0, 8.0)
    lengths: tuple[float, float] = (0.60, 0.55)
    centres: tuple[float, float] = (0.30, 0.25)
    inertias: tuple[float, float] = (0.4, 0.2)
    payload: float = 8.0
    Jm: tuple[float, float] = (5.0e-3, 2.5e-3)
    k: tuple[float, float] = (8.0e4, 2.5e4)
    d: tuple[float, float] = (120.0, 30.0)
    fm: tuple[float, float] = (4.0e-3, 1.5e-3)
    fc: tuple[float, float] = (0.30, 0.10)
    stribeck: tuple[float, float] = (0.05, 0.02)
    ripple: tuple[float, float] = (0.01, 0.01)
    disturbance: tuple[float, float] = (0.03, 0.01)

    @property
    def inertia(self) -> Floats:
        """Of motors and arm at the motors (2,), with the elbow at a right angle."""
        (l1, l2), (c1, c2), (m1, m2) = self.lengths, self.centres, self.masses
        elbow = self.inertias[1] + m2 * c2**2 + self.payload * l2**2
        shoulder = self.inertias[0] + m1 * c1**2 + (m2 + self.payload) * l1**2 + elbow
        return np.array(self.Jm) + R**2 * np.array([shoulder, elbow])


def redrawn(rng: np.random.Generator) -> ArmTruth:
    """All values by up to a fifth more or less."""
    return redrawn_fields(rng, ArmTruth(), 0.2)


class ArmSamples(NamedTuple):
    """Samples in a row: times, and of shoulder and elbow the torques as reported and the motor angles (N, 2)."""

    t_us: NDArray[np.int64]
    u: Floats
    y: Floats


class Arm:
    """The arm in time.  Its motions, disturbance and phases of the ripple come from ``rng``."""

    def __init__(self, truth: ArmTruth, rng: np.random.Generator) -> None:
        self.truth, self._rng = truth, rng
        start = np.array([0.5, -1.0])
        # Motor angles, speeds, link angles, speeds; integrals of the controllers, disturbances.
        self._x = np.concatenate([start / R, np.zeros(2), start, np.zeros(2), np.zeros(4)])
        self._phase = rng.uniform(0, 2 * np.pi, 2)
        self._moves = [Moves(partial(self._next_move, axis), float(at)) for axis, at in enumerate(start)]
        self._at, self._pace = 0, 1.0

    def take(
        self,
        seconds: float,
        changes: Mapping[str, float] | None = None,
        test: Floats | None = None,
        pace: float = 1.0,
    ) -> ArmSamples:
        """The next samples; meanwhile values are so many times as large: {"payload": 1.3, "elbow fm": 1.5}.

        ``test`` (N, 2) are torques that are added to the controllers' [N m].  ``pace``: how fast the
        motions are that begin now, over those of operation.
        """
        truth, factor = self.truth, {**(changes or {})}
        N = round(seconds / INTERVAL_S)
        k = self._at + np.arange(N)
        t = np.asarray(k * INTERVAL_S, np.float64)
        self._pace = pace
        moves = [own.between(float(t[0]), float(t[-1]) + INTERVAL_S) for own in self._moves]
        own = np.array(
            [
                [values[a] * factor.get(f"{AXES[a]} {name}", 1.0) for a in range(2)]
                for name, values in (("kT", (1.0, 1.0)), ("fm", truth.fm), ("fc", truth.fc))
            ]
        )
        payload = truth.payload * factor.get("payload", 1.0)
        fixed = np.array([truth.Jm, truth.k, truth.d, truth.stribeck, truth.ripple, truth.disturbance, self._phase])
        links = np.array([truth.masses, truth.lengths, truth.centres, truth.inertias])
        inertia = truth.inertia
        gains = np.array([[BANDWIDTH / 1.5] * 2, inertia * BANDWIDTH * 1.5, inertia])
        u, y = np.empty((N, 2)), np.empty((N, 2))
        _simulate(
            links, payload, fixed, own, gains, moves[0], moves[1], t, self._rng.standard_normal((N, 2)),
            np.zeros((N, 2)) if test is None else test, self._x, u, y,
        )  # fmt: skip
        self._at += N
        return ArmSamples(np.round(k * INTERVAL_S * 1e6).astype(np.int64), u, np.round(y / STEP) * STEP)

    def _next_move(self, axis: int, at: float) -> tuple[float, float, float]:
        rng, to = self._rng, self._rng.uniform(*POSES[axis])
        pace, distance = self._pace * rng.uniform(SLOWEST, 1.0), abs(to - at)
        duration_s = max(shortest_s(distance, pace * SPEED, pace**2 * ACCELERATION), 0.2)
        return to, duration_s, rng.uniform(*DWELL_S)


@entry
def _simulate(
    links: Floats,
    payload: float,
    fixed: Floats,
    own: Floats,
    gains: Floats,
    moves0: Floats,
    moves1: Floats,
    t: Floats,
    noise: Floats,
    test: Floats,
    x: Floats,
    u: Floats,
    y: Floats,
) -> None:
    """Cascaded control with feedforward along minimum-jerk moves; ``x`` (12,) goes on."""
    h = INTERVAL_S / SUBSTEPS
    a = np.exp(-INTERVAL_S / DISTURBANCE_S)
    m1, m2, l1, l2 = links[0, 0], links[0, 1], links[1, 0], links[1, 1]
    c1, c2, I1, I2 = links[2, 0], links[2, 1], links[3, 0], links[3, 1]
    A = I1 + m1 * c1**2 + (m2 + payload) * l1**2
    B = I2 + m2 * c2**2 + payload * l2**2
    D = l1 * (m2 * c2 + payload * l2)
    G1, G2 = GRAVITY * (m1 * c1 + (m2 + payload) * l1), GRAVITY * (m2 * c2 + payload * l2)
    at, tau, total = np.zeros(2, np.int64), np.zeros(2), np.zeros(2)
    for k in range(t.size):
        for i in range(2):
            x[10 + i] = a * x[10 + i] + np.sqrt(1 - a * a) * fixed[5, i] * noise[k, i]
            y[k, i] = x[i]
            total[i] = 0.0
        for part in range(SUBSTEPS):
            now = t[k] + part * h
            for i in range(2):
                moves = moves0 if i == 0 else moves1
                while at[i] + 1 < moves.shape[0] and moves[at[i] + 1, 0] <= now:
                    at[i] += 1
                wanted, wanted_speed, acceleration = motion(moves, at[i], now)
                off = gains[0, i] * (wanted / R - x[i]) + wanted_speed / R - x[2 + i]
                x[8 + i] += gains[1, i] * h / INTEGRAL_S * off
                torque = gains[1, i] * off + x[8 + i] + gains[2, i] * (acceleration / R) + test[k, i]
                total[i] += torque
                v = x[2 + i]
                rubbing = (own[2, i] + fixed[3, i] * np.exp(-((v / STRIBECK_SPEED) ** 2))) * np.tanh(
                    v / SLIDING_SPEED
                ) + own[1, i] * v
                acting = own[0, i] * torque * (1 + fixed[4, i] * np.sin(PER_TURN * x[i] + fixed[6, i]))
                tau[i] = fixed[1, i] * (R * x[i] - x[4 + i]) + fixed[2, i] * (R * x[2 + i] - x[6 + i])
                x[2 + i] += h / fixed[0, i] * (acting + x[10 + i] - rubbing - R * tau[i])
            cos2, sin2 = np.cos(x[5]), np.sin(x[5])
            M11, M12, M22 = A + B + 2 * D * cos2, B + D * cos2, B
            lower = G2 * np.cos(x[4] + x[5])
            b1 = tau[0] + D * sin2 * (2 * x[6] * x[7] + x[7] ** 2) - G1 * np.cos(x[4]) - lower
            b2 = tau[1] - D * sin2 * x[6] ** 2 - lower
            det = M11 * M22 - M12 * M12
            x[6] += h * (M22 * b1 - M12 * b2) / det
            x[7] += h * (M11 * b2 - M12 * b1) / det
            for i in range(2):
                x[i] += h * x[2 + i]
                x[4 + i] += h * x[6 + i]
        for i in range(2):
            u[k, i] = total[i] / SUBSTEPS
