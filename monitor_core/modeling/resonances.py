"""Poles, resonances and anti-resonances of a drive at given parameter values."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from monitor_core.arrays import Complexes, Floats
from monitor_core.kernel.tables import TORQUE
from monitor_core.modeling.statespace import Entries, StateSpace

_ROUNDING = 1e-12
"""Relative size below which a root counts as zero, and so does an element that stands for a direct effect."""
_REAL = 1e-6
"""Relative imaginary part below which a root is real; for a double root it is about the root of the rounding error."""


@dataclass(frozen=True, slots=True)
class ResonantMode:
    """An oscillating pair of roots: natural frequency |s| / 2 pi, and damping ratio -Re s / |s|."""

    frequency_hz: float
    damping: float


@dataclass(frozen=True, slots=True)
class Resonances:
    """Poles, zeros and resonances from the first motor torque to the first sensor.

    ``poles`` and ``zeros`` in rad/s, the slow ones first.
    """

    poles: tuple[complex, ...]
    zeros: tuple[complex, ...]
    resonances: tuple[ResonantMode, ...]
    antiresonances: tuple[ResonantMode, ...]


def resonances_of(ss: StateSpace, nominal: Mapping[str, float]) -> Resonances:
    """Resonances at the nominal values of all parameters."""
    torque = next(column for column, u in enumerate(ss.inputs) if u.kind == TORQUE)
    A, B, C = (_at(*each, nominal) for each in zip((ss.A, ss.B, ss.C), ss.shapes, strict=True))
    return resonances(A, B[:, torque], C[0])


def resonances(A: Floats, b: Floats, c: Floats) -> Resonances:
    """Resonances of  x' = A x + b u,  y = c x  with A (n, n), b (n,), c (n,)."""
    A, b, c = _balanced(A, b, c)
    poles, zeros = _sorted(np.linalg.eigvals(A)), _sorted(zeros_of(A, b, c))
    return Resonances(poles=poles, zeros=zeros, resonances=modes(poles), antiresonances=modes(zeros))


def modes(roots: Iterable[complex]) -> tuple[ResonantMode, ...]:
    """The mode of each oscillating pair."""
    upper = [s for s in roots if s.imag > _REAL * abs(s)]
    return tuple(ResonantMode(abs(s) / (2 * math.pi), -s.real / abs(s)) for s in upper)


def zeros_of(A: Floats, b: Floats, c: Floats) -> Complexes:
    """Invariant zeros (rad/s) of one input and one output, balanced.

    While the input has no direct effect, holding the output at zero removes one state, and the variable that drives
    that state becomes the new output.  So the dimension falls by the relative degree, by orthogonal transformations,
    and no infinite zero is left whose rounding error could look like a finite one.
    """
    d = 0.0
    while abs(d) <= _ROUNDING * np.hypot(np.linalg.norm(b), d):
        if not len(A) or np.linalg.norm(c) == 0:
            return np.zeros(0, dtype=complex)  # the input does not reach the output
        H = _reflection(c)
        A, b = H @ A @ H, H @ b
        A, b, c, d = A[1:, 1:], b[1:], A[0, 1:], b[0]
    return np.linalg.eigvals(A - np.outer(b, c) / d).astype(complex)


def _reflection(c: Floats) -> Floats:
    """Orthogonal and symmetric H with c H = (+-|c|, 0 .. 0); a permutation where c has one element."""
    v = c.astype(float)
    if np.count_nonzero(v) == 1:
        order = np.arange(len(v))
        k = int(np.flatnonzero(v)[0])
        order[[0, k]] = order[[k, 0]]
        return np.eye(len(v))[order]
    v[0] += math.copysign(float(np.linalg.norm(v)), v[0])
    return np.asarray(np.eye(len(v)) - 2 * np.outer(v, v) / (v @ v))


def _balanced(A: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """The drive in units of states and input with which rows and columns of [A b; c 0] have similar sizes.

    Balancing A alone would not suffice: an angle that only the sensor depends on could have any unit.
    """
    pencil = np.block([[A, b[:, None]], [c[None], np.zeros((1, 1))]])
    balanced, _ = sla.matrix_balance(pencil, permute=False, separate=True)
    out = np.asarray(balanced, dtype=float)
    return out[:-1, :-1], out[:-1, -1], out[-1, :-1]


def _sorted(roots: NDArray[np.inexact]) -> tuple[complex, ...]:
    """Sorted by magnitude; values of rounding size are zero."""
    largest = np.abs(roots).max(initial=0.0)
    exact = np.where(np.abs(roots) <= _ROUNDING * largest, 0, roots)
    return tuple(sorted(exact.tolist(), key=lambda s: (abs(s), s.real, s.imag)))


def _at(entries: Entries, shape: tuple[int, int], values: Mapping[str, float]) -> Floats:
    out = np.zeros(shape)
    for place, entry in entries.items():
        out[place] = entry.value(values)
    return out
