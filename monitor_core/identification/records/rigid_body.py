"""The whole drive as one rigid mass: its inertia by the nominal values, and by a record without any.

Below its resonances a drive moves as one mass J under the torque u,

    J w' = u - f w - fc tanh(w / s) - tau0,

(f and fc of the whole drive).  Multiplied by a smooth window g of length T that vanishes with its derivative at both
ends, and integrated by parts, no derivative of a measurement is left,

    -J int g' w = int g u - f int g w - ..,     or with the angle      J int g'' phi = int g u + f int g' phi - ..,

so the equation is linear in J, f, fc, .. and every position of the window gives one equation.  (Modulating functions:
Shinbrot 1957; Preisig and Rippin 1993.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigvals
from scipy.signal import oaconvolve

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Drive, Output
from monitor_core.identification.records.record import Record, segments
from monitor_core.identification.records.uniform_grid import mean_torque
from monitor_core.kernel.tables import TORQUE

_WINDOWS = 4
"""Equations for each length of the window; closer ones hold nothing new."""
_FEWEST_WINDOWS = 12
"""Lengths of the window that fit into the record."""
_SHORTEST = 24
"""Samples in a window: sums are integrals then, to 1e-3."""


_GAP = 10.0
"""Typical intervals: what acted in a longer one is not known."""


class _Part(NamedTuple):
    """A piece of a record on a regular grid: torque around each sample and motion (N,), interval in s."""

    u: Floats
    y: Floats
    h: float
    quantity: Output


class Rigid(NamedTuple):
    """A record explained by one rigid mass."""

    inertia: float
    """kg m^2, with its standard deviation"""
    sd: float
    explained: float
    """part of the variance of the windowed torque that the model explains, 1: all"""


def rigid_inertia(drive: Drive, values: Mapping[str, float]) -> float:
    """The inertia of the whole drive, kg m^2, as a measured torque feels it: with a torque constant of 2 half of it.

    Near standstill the torque for a speed w is  1/G(s) = f + J s + O(s^2)  with the transfer function G.

    Raises:
        KeyError, ValueError: a value is missing or makes no sense.
    """
    values = drive.complete(values)
    A, B, C = (drive.matrix(which, values) for which in ("A", "B", "C"))
    torque = B[:, [kind == TORQUE for kind in drive.inputs]].sum(axis=1)
    poles = abs(np.linalg.eigvals(A))
    s = 1e-4j * poles[poles > 1e-6 * poles.max()].min()
    G = complex(C[0] @ np.linalg.solve(s * np.eye(len(A)) - A, torque))
    return float((1 / G / (s if drive.output == "angle" else 1)).imag / s.imag)


def antiresonance_s(drive: Drive, values: Mapping[str, float]) -> float | None:
    """Period, s, of the lowest antiresonance: motions much slower than that are rigid.  None: the drive has none.

    Raises:
        KeyError, ValueError: a value is missing or makes no sense.
    """
    values = drive.complete(values)
    A, B, C = (drive.matrix(which, values) for which in ("A", "B", "C"))
    torque = B[:, [kind == TORQUE for kind in drive.inputs]].sum(axis=1, keepdims=True)
    n = len(A)
    pencil = np.block([[A, torque], [C, np.zeros((1, 1))]]), np.diag([1.0] * n + [0.0])
    zeros = np.asarray(eigvals(*pencil), np.complex128)
    swinging = abs(zeros[np.isfinite(zeros) & (zeros.imag > 1e-6 * abs(zeros))])
    return float(2 * np.pi / swinging.min()) if swinging.size else None


def rigid_fit(record: Record, speed_scale: float = 1.0, shortest_s: float = 0.0) -> Rigid | None:
    """The best of the fits with windows of different length, at least ``shortest_s``; None: none explains anything.

    Motions faster than a third of a window are suppressed.  ``speed_scale`` [rad/s] is that of Coulomb friction.
    """
    pieces = segments(record, _GAP * record.interval_s)
    parts = [_part(piece) for piece in pieces if np.count_nonzero(piece.measured) > 1]
    shortest = max(_SHORTEST, shortest_s / record.interval_s)
    ladder = _ladder(shortest, sum(len(part.u) for part in parts))
    fits = [fit for window in ladder if (fit := _fit(parts, window, speed_scale)) is not None]
    return max(fits, key=lambda fit: fit.explained, default=None)


def _ladder(shortest: float, count: int) -> list[int]:
    """Lengths of the window in samples, each one and a half times the one before, for that many samples."""
    lengths, most = [], count // _FEWEST_WINDOWS
    length = shortest
    while length <= most:
        lengths.append(int(length))
        length *= 1.5
    return lengths


def _fit(parts: Sequence[_Part], window: int, speed_scale: float) -> Rigid | None:
    equations = [_equations(part, window, speed_scale) for part in parts if len(part.u) > window]
    if not equations:
        return None
    rows, torque = (np.concatenate(of_parts) for of_parts in zip(*equations, strict=True))
    scale = np.sqrt((rows**2).sum(axis=0))
    spread = float(((torque - torque.mean()) ** 2).sum())
    if not (scale > 0).all() or spread <= 0 or len(torque) <= rows.shape[1] + 2:
        return None
    found, _, rank, _ = np.linalg.lstsq(rows / scale, torque, rcond=1e-8)
    if rank < rows.shape[1]:
        return None
    residual = torque - rows / scale @ found
    variance = float(residual @ residual) / (len(torque) - rank)
    covariance = variance * np.linalg.inv((rows / scale).T @ (rows / scale))
    sd = float(np.sqrt(covariance[0, 0]) / scale[0])
    explained = 1 - float(residual @ residual) / spread
    return Rigid(float(found[0] / scale[0]), sd, explained)


def _part(segment: Record) -> _Part:
    """The record on a regular grid: the mean torque is exact, and the motion is almost straight between samples."""
    t = np.linspace(segment.t[0], segment.t[-1], len(segment))
    y = np.interp(t, segment.t[segment.measured], segment.y[segment.measured])
    u = mean_torque(segment, t)
    # Mean of the torques before and after each sample.
    return _Part(np.convolve(u, (0.5, 0.5))[: len(u)], y, float(t[1] - t[0]), segment.quantity)


def _equations(part: _Part, window: int, speed_scale: float) -> tuple[Floats, Floats]:
    """Columns (M, 4) for J, f, fc and tau0; the windowed torque (M,)."""
    g, g1, g2 = _window(window, part.h)

    def over(weight: Floats, values: Floats) -> Floats:
        # A convolution reverses its second factor.
        out: Floats = part.h * oaconvolve(values, weight[::-1], mode="valid")[:: window // _WINDOWS]
        return out

    y = part.y
    if part.quantity == "speed":
        speed, inertia, viscous = y, -over(g1, y), over(g, y)
    else:
        speed = _slope(y, window // 8, part.h)
        inertia, viscous = over(g2, y - y[0]), -over(g1, y - y[0])
    columns = [inertia, viscous, over(g, np.tanh(speed / speed_scale)), over(g, np.ones_like(y))]
    return np.column_stack(columns), over(g, part.u)


def _slope(angle: Floats, half: int, interval_s: float) -> Floats:
    """Mean speed (N,) over ``half`` samples on either side; only its sign is wanted."""
    around = np.pad(angle, half, mode="reflect", reflect_type="odd")
    slope: Floats = (around[2 * half :] - around[: -2 * half]) / (2 * half * interval_s)
    return slope


def _window(count: int, interval_s: float) -> tuple[Floats, Floats, Floats]:
    """g = sin^4 over the window (count + 1,), and its first two derivatives."""
    x = np.pi * np.arange(count + 1) / count
    w = np.pi / (count * interval_s)
    sin, cos = np.sin(x), np.cos(x)
    return sin**4, 4 * w * sin**3 * cos, 4 * w**2 * (3 * sin**2 * cos**2 - sin**4)
