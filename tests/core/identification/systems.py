"""Axes whose response is known: the bench of the peers' comparison, and small random systems."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter, ss2tf

from monitor_core.arrays import Complexes, Floats
from monitor_core.drive.discretization import zero_order_hold
from monitor_core.identification import Record
from monitor_core.identification.black_boxes.frequency_response import on_circle

INTERVAL_S = 0.005


@dataclass(frozen=True)
class Discrete:
    """x(t+1) = A x + B u, y = C x."""

    A: Floats
    B: Floats
    C: Floats
    interval_s: float = INTERVAL_S

    def response(self, frequency_hz: ArrayLike) -> Complexes:
        _, z = on_circle(frequency_hz, self.interval_s)
        eye = np.eye(len(self.A))
        return np.array([(self.C @ np.linalg.solve(w * eye - self.A, self.B))[0, 0] for w in z])

    def simulate(self, u: Floats) -> Floats:
        x, out = np.zeros(len(self.A)), np.empty(len(u))
        for k, value in enumerate(u.tolist()):
            out[k] = self.C[0] @ x
            x = self.A @ x + self.B[:, 0] * value
        return out


def bench_drive() -> Discrete:
    """A stiff three-mass drive with the motor speed as output, held: 12.95 and 21.9 Hz, slowest 1 s."""
    Jm, Jg, Ja, k1, k2, d1, d2, fm = 0.004, 0.01, 0.006, 50.0, 30.0, 0.08, 0.04, 0.02
    A = [
        [0, 0, 1, -1, 0],
        [0, 0, 0, 1, -1],
        [-k1 / Jm, 0, -(fm + d1) / Jm, d1 / Jm, 0],
        [k1 / Jg, -k2 / Jg, d1 / Jg, -(d1 + d2) / Jg, d2 / Jg],
        [0, k2 / Ja, 0, d2 / Ja, -d2 / Ja],
    ]
    Ad, Bd = zero_order_hold(np.array(A), np.array([[0.0, 0, 1 / Jm, 0, 0]]).T, INTERVAL_S)
    return Discrete(Ad, Bd, np.array([[0, 0, 1.0, 0, 0]]))


def schroeder(N: int) -> Floats:
    """60 sines from 0.5 to 40 Hz with Schroeder's phases, rms 1."""
    k = np.arange(60)
    f, phase = np.linspace(0.5, 40, 60), -np.pi * k * (k - 1) / 60
    u = np.cos(2 * np.pi * np.outer(np.arange(N) * INTERVAL_S, f) + phase).sum(axis=1)
    return np.asarray(u / u.std())


def bench_record(rng: np.random.Generator, N: int = 8000, noise_db: float = -30.0) -> Record:
    """Multisine and white noise as torque, white noise on the speed."""
    u = schroeder(N) + 0.3 * rng.normal(size=N)
    y = bench_drive().simulate(u)
    y += rng.normal(size=N) * y.std() * 10 ** (noise_db / 20)
    return Record(times(N), u, y, "speed", "bench")


def arx_record(rng: np.random.Generator, a: Floats, b: Floats, N: int, sd: float) -> Record:
    """White torque through an ARX system, started long before the record."""
    u, e = rng.normal(size=(2, N + 500))
    A = np.concatenate([[1.0], a])
    y = lfilter([0.0, *b], A, u) + sd * lfilter([1.0], A, e)
    return Record(times(N), u[500:], y[500:], "speed")


def times(N: int) -> Floats:
    return np.arange(N, dtype=np.float64) * INTERVAL_S


def decibels(G: Complexes, truth: Complexes) -> Floats:
    """|G| above the truth, dB."""
    return np.asarray(20 * np.log10(np.abs(G) / np.abs(truth)))


def innovations_record(
    rng: np.random.Generator, drive: Discrete, K: Floats, u: Floats, sd: float, feedback: float = 0.0
) -> Record:
    """y = C x + e, the torque u (N,) less the feedback of y."""
    N, (B, C) = len(u), (drive.B[:, 0], drive.C)
    e, closed = sd * rng.normal(size=N), drive.A - feedback * drive.B @ drive.C
    y = _filtered(closed, B, C, u) + _filtered(closed, K - feedback * B, C, e) + e
    return Record(times(N), u - feedback * y, y, "speed")


def _filtered(A: Floats, B: Floats, C: Floats, u: Floats) -> Floats:
    """C (zI - A)^-1 B u by its difference equation."""
    b, a = ss2tf(A, B[:, None], C, np.zeros((1, 1)))
    return np.asarray(lfilter(b[0], a, u))


def small_drive() -> tuple[Discrete, Floats]:
    """Two states, one resonance at 15 Hz, and a gain K of its noise."""
    r, w = 0.93, 0.47
    A = r * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]])
    return Discrete(A, np.array([[0.4], [0.7]]), np.array([[1.0, 0.3]])), np.array([0.3, -0.2])
