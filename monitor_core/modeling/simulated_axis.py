"""Simulated drives for tests and the demo.

``SimulatedAxis`` is one axis in time, with Coulomb friction, gravity and parameters that may change at any moment.
``simulate_linear`` runs many records of a linear drive side by side.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.linalg import toeplitz

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.drive.structure import Drive
from monitor_core.kernel.tables import COSINE, COULOMB, OF_ANGLE, OF_MOTION, ONE, SINE, TORQUE
from monitor_core.modeling.standard_drives import three_mass


class SimulatedAxis:
    """A drive with its true parameter values.

    Its linear part is discretised exactly.  Coulomb friction and gravity depend on the motion, so they are held only
    over ``substeps`` equal parts of an interval.  At their flanges the motion is the sensor's times the ratio.

    Values may be given as for AxisModel.  ``speed_scale`` is as in Settings.  The default ``drive`` is the three-mass
    one.

    Raises:
        KeyError: a parameter that the drive does not have, or a value that is missing.
        ValueError: a value that makes no sense; fewer than one substep.
    """

    def __init__(
        self,
        values: Mapping[str, float],
        speed_scale: float = 1.0,
        substeps: int = 5,
        drive: Drive | None = None,
    ) -> None:
        if substeps < 1:
            raise ValueError(f"{substeps} substeps: at least one is needed")
        self._drive = drive or three_mass("angle")
        self._speed_scale, self._substeps = speed_scale, substeps
        self._x = np.zeros(len(self._drive.states))
        self._values: dict[str, float] = {}
        self.set(values)

    @property
    def values(self) -> dict[str, float]:
        """The present parameter values, as they were given (a copy)."""
        return dict(self._values)

    @property
    def angle(self) -> float:
        """Present angle at the sensor, rad; 0 for a drive with the speed as output, which has no angle."""
        return float(self._C.dot(self._x)) if self._drive.output == "angle" else 0.0

    @property
    def speed(self) -> float:
        """Present speed at the sensor, rad/s."""
        return float(self._speed.dot(self._x))

    def set(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name; the others and the motion stay as they are.

        A part of a merged parameter changes that with it, unless it is given, too.

        Raises:
            KeyError: a parameter that the drive does not have.
            ValueError: a value that makes no sense.
        """
        merged = {part for name in values for part in self._drive.merged_from(name)}
        given = {name: v for name, v in self._values.items() if name not in merged} | dict(values)
        model = AxisModel(self._drive, given, ())
        self._values = given
        self._A, self._B, C = model.matrices()
        self._C = C[0]
        self._speed = C[0] if self._drive.output == "speed" else C[0] @ self._A
        kinds, ratio = self._drive.inputs, self._drive.matrix("ratio", model.nominal)[:, 0].tolist()
        self._constant = np.array([float(kind == ONE) for kind in kinds])
        self._of_torque = [i for i, kind in enumerate(kinds) if kind == TORQUE]
        self._friction = [(i, ratio[i]) for i, kind in enumerate(kinds) if kind == COULOMB]
        self._weight = [(i, _OF_ANGLE[kind], ratio[i]) for i, kind in enumerate(kinds) if kind in OF_ANGLE]
        self._parts = self._substeps if self._drive.acts(OF_MOTION, model.nominal) else 1
        self._held: dict[float, tuple[Floats, Floats]] = {}

    def step(self, torque: float, interval_s: float) -> tuple[float, float]:
        """Hold the torque [N m] over the interval [s]; returns angle [rad] and speed [rad/s] at its end."""
        h = interval_s / self._parts
        if h not in self._held:
            self._held[h] = zero_order_hold(self._A, self._B, h)
        Ad, Bd = self._held[h]
        u = self.inputs(torque)
        for part in range(self._parts):
            if part:
                self._follow(u)
            self._x = Ad.dot(self._x) + Bd.dot(u)
        return self.angle, self.speed

    def inputs(self, torque: float) -> Floats:
        """All present inputs of the drive (m,), with this torque [N m]."""
        u = self._constant.copy()
        for i in self._of_torque:
            u[i] = torque
        self._follow(u)
        return u

    def _follow(self, u: Floats) -> None:
        """Write friction and gravity of the present motion to u (m,)."""
        if self._friction:
            speed = self.speed / self._speed_scale  # in units of that of Coulomb friction
            for i, ratio in self._friction:
                u[i] = math.tanh(ratio * speed)
        if self._weight:
            angle = self.angle
            for i, function, ratio in self._weight:
                u[i] = function(ratio * angle)


_OF_ANGLE: Mapping[int, Callable[[float], float]] = {COSINE: math.cos, SINE: math.sin}
"""Inputs that depend on the angle, of one number: much faster than as of arrays."""


BLOCK = 64
"""Number of steps of a linear drive that are computed at once: as exact as one by one, and fifty times as fast."""


def simulate_linear(
    drive: Drive, values: Mapping[str, float], u: Floats, interval_s: float, start: Floats | None = None
) -> tuple[Floats, Floats]:
    """Output y (N, W) for the torque u (N, W) held from sample to sample, and the states (n, W) at the end.

    y[k] is measured when u[k] starts to act: y[0] belongs to the state ``start`` (n, W), default 0.  A mean
    speed is that over the interval before.

    Raises:
        ValueError: there is Coulomb friction or gravity, which is not linear.
    """
    values = drive.complete(values)
    if drive.acts(OF_MOTION, values):
        raise ValueError("Coulomb friction and gravity are not linear: use SimulatedAxis")
    A, B, (C,) = drive.matrices(values)
    Ad, Bd = zero_order_hold(A, B, interval_s)
    if drive.mean_state >= 0:
        Ad[:, drive.mean_state], C = 0.0, C / interval_s
    torque = Bd[:, drive.of_torque]
    constant = Bd[:, [kind == ONE for kind in drive.inputs]].sum(axis=1, keepdims=True)
    x = np.zeros((len(drive.states), u.shape[1])) if start is None else start
    y = np.empty(u.shape)
    blocks = {n: _lifted(Ad, torque, constant, C, n) for n in {min(BLOCK, len(u)), len(u) % BLOCK} - {0}}
    for k in range(0, len(u), BLOCK):
        piece = u[k : k + BLOCK]
        O, T, s, A, R, c = blocks[len(piece)]
        y[k : k + BLOCK] = O @ x + T @ piece + s
        x = A @ x + R @ piece + c
    return y, x


def _lifted(Ad: Floats, b: Floats, c: Floats, C: Floats, n: int) -> tuple[Floats, ...]:
    """n steps of  y = C x,  x+ = Ad x + b u + c  in one:  y = O x + T u + s,  x+ = A x + R u + r."""
    powers = [np.eye(len(Ad))]
    for _ in range(n):
        powers.append(Ad @ powers[-1])
    impulse = np.array([0.0, *(C @ power @ b[:, 0] for power in powers[:-1])])
    drift = np.cumsum([np.zeros_like(c), *(power @ c for power in powers[:-1])], axis=0)
    return (
        np.array([C @ power for power in powers[:-1]]),
        toeplitz(impulse[:-1], np.zeros(n)),
        drift[:-1, :, 0] @ C[:, np.newaxis],
        powers[-1],
        np.hstack([power @ b for power in powers[-2::-1]]),
        drift[-1],
    )
