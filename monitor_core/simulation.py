"""The plant: drives that tests and the demo run against.

``SimulatedAxis`` is one axis in time, with Coulomb friction and parameters that may change at any moment.
``simulate_linear`` runs many records of a drive without Coulomb friction side by side.
"""

import math
from collections.abc import Mapping

import numpy as np

from monitor_core.discretize import zero_order_hold
from monitor_core.kernel.tables import COULOMB, TORQUE, Floats
from monitor_core.library import three_mass
from monitor_core.model import AxisModel, Drive


class SimulatedAxis:
    """A drive with its true parameter values.

    Its linear part is discretised exactly.  Coulomb friction depends on the speed, so it is held only over
    ``substeps`` equal parts of an interval.

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
        """The parameter values now (a copy)."""
        return dict(self._values)

    @property
    def angle(self) -> float:
        """Motor angle now, rad."""
        return float((self._C @ self._x)[0])

    @property
    def speed(self) -> float:
        """Motor speed now, rad/s."""
        return float(self._x[self._drive.speed_state])

    def set(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name; the others and the motion stay as they are.

        Raises:
            KeyError: a parameter that the drive does not have.
            ValueError: a value that makes no sense.
        """
        model = AxisModel(self._drive, {**self._values, **values}, ())
        self._values = dict(model.nominal)
        self._A, self._B, self._C = model.matrices()
        self._held: dict[float, tuple[Floats, Floats]] = {}

    def step(self, torque: float, interval_s: float) -> tuple[float, float]:
        """Hold the torque [N m] over the interval [s]; returns angle [rad] and speed [rad/s] at its end."""
        parts = self._substeps if self._values.get("fc") else 1
        h = interval_s / parts
        if h not in self._held:
            self._held[h] = zero_order_hold(self._A, self._B, h)
        Ad, Bd = self._held[h]
        for _ in range(parts):
            self._x = Ad @ self._x + Bd @ self._inputs(torque)
        return self.angle, self.speed

    def _inputs(self, torque: float) -> Floats:
        friction = math.tanh(self.speed / self._speed_scale)
        return np.array([{TORQUE: torque, COULOMB: friction}.get(kind, 1.0) for kind in self._drive.inputs])


def simulate_linear(
    drive: Drive, values: Mapping[str, float], u: Floats, interval_s: float, start: Floats | None = None
) -> tuple[Floats, Floats]:
    """Output y (N, W) for the torque u (N, W) held from sample to sample, and the states (n, W) at the end.

    y[k] is what is measured when u[k] starts to act: y[0] belongs to the state ``start`` (n, W), default 0.

    Raises:
        ValueError: there is Coulomb friction, which is not linear.
    """
    if values.get("fc"):
        raise ValueError("Coulomb friction fc is not linear: use SimulatedAxis")
    C = drive.matrix("C", values)[0]
    Ad, Bd = zero_order_hold(drive.matrix("A", values), drive.matrix("B", values), interval_s)
    torque = Bd[:, [kind == TORQUE for kind in drive.inputs]]
    constant = Bd[:, [kind not in (TORQUE, COULOMB) for kind in drive.inputs]].sum(axis=1, keepdims=True)
    x = np.zeros((len(drive.states), u.shape[1])) if start is None else start
    y = np.empty(u.shape)
    for k in range(len(u)):
        y[k] = C @ x
        x = Ad @ x + torque * u[k] + constant
    return y, x


def simulate_speed(model: AxisModel, values: Mapping[str, float], u: Floats, interval_s: float) -> Floats:
    """Output of the model's drive from rest, for one torque record (N,) or many (N, W), without noise.

    Raises:
        ValueError: the drive's output is not the speed; there is Coulomb friction.
    """
    if model.drive.output != "speed":
        raise ValueError("the output of this drive is the angle: use simulate_linear")
    y, _ = simulate_linear(model.drive, values, u.reshape(len(u), -1), interval_s)
    return y.reshape(u.shape)
