"""The system between samples: its derivatives, its exponential, and what acts on it.  Nothing of the kernel's."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, matrix_balance

from monitor_core.drive.axis_model import AxisModel
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE, WEIGHT
from monitor_core.settings import Settings

Array = NDArray[np.float64]
LOST = 1.75  # intervals: then a mean speed is that over the last one
STEP = 1e-30  # of the complex step; far below rounding, so that the derivative is exact


class Matrices:
    """A, B and C of a model.  The last few are kept: the derivatives and friction of an interval ask for the same."""

    KEPT = 32

    def __init__(self, model: AxisModel) -> None:
        self.model = model
        self._kept: dict[tuple[complex, ...], tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = {}

    def at(self, theta: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """A, B and C at theta, which may be complex; not to be written to."""
        key = tuple(theta.tolist())
        if key not in self._kept:
            if len(self._kept) >= self.KEPT:
                self._kept.clear()
            self._kept[key] = self.model.matrices(theta)
        return self._kept[key]

    @cached_property
    def to_speed(self) -> Array:
        """The row of the speed at the sensor, y or y' = C A x (the inputs have no direct effect on it), at nominal."""
        A, _, C = self.model.matrices()
        return np.asarray(C[0] if self.model.drive.output == "speed" else (C @ A)[0])

    @cached_property
    def rubs(self) -> NDArray[np.bool_]:
        """Which inputs are friction."""
        return np.array([kind == COULOMB for kind in self.model.drive.inputs])

    @cached_property
    def ratios_of_friction(self) -> Array:
        return np.asarray(self.model.drive.matrix("ratio", self.model.nominal)[self.rubs, 0])


def derivatives(matrices: Matrices, theta: Array) -> tuple[list[Array], list[Array], list[Array]]:
    """dA, dB and dC/dtheta_i for each i, by the complex step."""
    out: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    for i in range(len(theta)):
        h = STEP * max(1.0, abs(theta[i]))
        for found, matrix in zip(out, matrices.at(theta + 1j * h * np.eye(len(theta))[i]), strict=True):
            found.append(np.imag(matrix) / h)
    return out


def held_over(F: NDArray[np.generic], f: NDArray[np.generic], w: NDArray[np.generic], h: float) -> Array:
    """w(h) of  w' = F w + f  with f constant: one exponential of the system with f as a further column.

    Balanced first: springs on the arm side and inertias on the motor side differ by 1e8: four digits.
    """
    size = len(w)
    M = np.zeros((size + 1, size + 1), dtype=np.result_type(F, f))
    M[:size, :size], M[:size, size] = F, f
    balanced, (d, _) = matrix_balance(M, permute=False, separate=True)
    return np.asarray((d * (expm(balanced * h) @ (np.append(w, 1.0) / d)))[:size])


class Interval(NamedTuple):
    """An interval before it is over: how long, how much later the torque acts, and which acts until then."""

    h: float
    delay: Any
    torque_before: float


def inputs(model: AxisModel, u: float, y: float, weight: float = 0.0) -> NDArray[Any]:
    """What acts after a sample (u, y, weight) but friction: torque, offset, weight, gravity."""
    ratio = model.drive.matrix("ratio", model.nominal)[:, 0]
    functions: dict[int, Callable[[float], Any]] = {
        TORQUE: lambda _: u,
        COULOMB: lambda _: 0.0,
        ONE: lambda _: 1.0,
        COSINE: lambda ratio: math.cos(ratio * y),
        SINE: lambda ratio: math.sin(ratio * y),
        WEIGHT: lambda _: weight,
    }
    return np.array([functions[kind](r) for kind, r in zip(model.drive.inputs, ratio, strict=True)])


def with_friction(
    matrices: Matrices,
    s: Settings,
    theta: NDArray[Any],
    held: NDArray[Any],
    y: float,
    x: NDArray[Any],
    during: Interval,
) -> NDArray[Any]:
    """The inputs with Coulomb friction of the speed at the middle of the interval; theta and x may be complex."""
    rubs, drives = matrices.rubs, np.array(matrices.model.drive.inputs) == TORQUE
    if not rubs.any():
        return held
    A, B, _ = matrices.at(theta)
    by = matrices.ratios_of_friction / s.speed_scale
    to_speed, h, delay = matrices.to_speed, during.h, during.delay
    late = delay if np.real(delay) < h else h
    # Part of the torque before in the mean speed of the interval; a torque that came early has moved x by as much.
    old = 1 - (1 - late / h) ** 2 if np.real(late) > 0 else 2 * late / h
    pushed = held + np.where(drives, old * (during.torque_before - held), 0.0)
    start = y if matrices.model.drive.output == "speed" else to_speed @ x
    w = start + h / 2 * to_speed @ (A @ x + B @ pushed)
    b = h / 2 * to_speed @ B[:, rubs]
    first = np.tanh(by * w / (1 - b @ by))
    out = np.array(held, dtype=np.result_type(held, w))
    out[rubs] = np.tanh(by * (w + b @ first))
    return out
