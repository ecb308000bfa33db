"""Frequency responses of records (at a hundred points) and of a drive, on the unit circle and outside of it.

A simulation of the whole record takes a hundred times as long as the response of a model at a hundred frequencies.  So
starting values are found from the response of an ARX model of high order, with its uncertainty.

Outside of the unit circle, at z = exp((sigma + j w) h), the response is that of signals weighted with exp(-sigma t):
every resonance appears damped by sigma more.  There the peaks of a model that is far off still overlap with those of
the record, which guides a search.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.signal import csd, lfilter, medfilt, welch

from monitor_core.arrays import Bools, Complexes, Floats, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.structure import DAMPING, STIFFNESS, Output
from monitor_core.identification.black_boxes.arx import Arx, fit_arx
from monitor_core.identification.black_boxes.frequency_response import DECIBEL
from monitor_core.identification.predictor.held_drive import LinearDrive, Structure, hold
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.uniform_grid import Regular, on_grid, resample, stretches

_ORDER = 100
"""Order of the ARX model: half a second of memory at 5 ms."""
_ROWS = 20
"""Least number of samples per order of the ARX model."""
_POINTS = 100
_SURE = 0.5
"""Relative standard deviation from which on the response counts as unknown."""
_WEAK = 1e-4
"""A frequency is not excited if the spectral density of the torque is below this share of the largest."""
_OWN = 0.3
"""Least share of the torque's power that is not caused by the noise of the record through a controller."""
_SEGMENT = 512
_SHORTEST_S = 0.004
"""Records that were sampled faster are resampled: drives have no resonance beyond 100 Hz that a motor would feel."""


@dataclass(frozen=True, eq=False)
class Target:
    """Required response of a model: G (F,) at z (F,), with weights (F,) of the relative errors."""

    z: Complexes
    G: Complexes
    weight: Floats
    interval_s: float


@dataclass(frozen=True, eq=False)
class Measured:
    """The response in the records."""

    output: Output  # the measured quantity
    arx: Arx  # source of the response
    frequency_hz: Floats  # (F,) where it is known
    sd: Floats  # (F,) standard deviation of its relative error, |dG| / |G|
    expected: float
    """Squared relative errors over ``sd`` of the right model: number of parameters of the ARX model in that band."""

    def target(self, shift: float = 0.0, surest: float = 0.0) -> Target:
        """The points at exp((shift + j w) h), ``shift`` in 1/s; none counts as surer than ``surest``."""
        z = np.exp((shift + 2j * np.pi * self.frequency_hz) * self.arx.interval_s)
        return Target(z, rational(self.arx, z), 1 / np.maximum(self.sd, surest), self.arx.interval_s)


def rational(arx: Arx, z: Complexes) -> Complexes:
    """B / A (F,) at any z (F,)."""
    past = (1 / z[:, None]) ** np.arange(1, arx.a.size + 1)
    return np.asarray((past @ arx.b) / (1 + past @ arx.a), dtype=np.complex128)


def measure(records: Sequence[Record]) -> Measured:
    """The response of all records together.

    Raises:
        ValueError: no record, different intervals, too few samples, or a torque that excites nothing.
    """
    series = regular(records)
    rows = sum(int(s.known.sum()) for s in series)
    arx = fit_arx(series, max(2, min(_ORDER, rows // _ROWS)))
    nyquist = 0.5 / arx.interval_s
    lowest = 0.15 / (arx.a.size * arx.interval_s)
    wide = np.linspace(lowest, 0.9 * nyquist, 2 * _POINTS)
    sure = (medfilt(_relative(arx, wide), 5) < _SURE) & _excited(arx, series, wide)
    first, end = max(stretches(sure), key=lambda band: band[1] - band[0], default=(0, 0))
    known = wide[first:end]
    if known.size < 5:
        raise ValueError("the records do not give a frequency response: the torque hardly moves the axis, or all that"
                         " was measured is noise")  # fmt: skip
    f = np.linspace(known[0], known[-1], _POINTS)
    sd = _relative(arx, f)
    f, sd = f[sd < _SURE], sd[sd < _SURE]
    band = f.size / _POINTS * (known[-1] - known[0]) / nyquist
    return Measured(records[0].quantity, arx, f, sd, 2 * arx.a.size * float(min(band, 1.0)))


def regular(records: Sequence[Record]) -> tuple[Regular, ...]:
    """On one grid: as they are where that is possible, resampled where they are irregular or needlessly fast."""
    if not records:
        raise ValueError("no record")
    slowest = max(record.interval_s for record in records)
    interval = max(slowest, _SHORTEST_S)
    if interval == slowest:
        try:
            return on_grid(records)
        except ValueError:
            interval = round(1.05 * interval, 6)
    return on_grid([resample(record, interval) for record in records])


def _excited(arx: Arx, series: Sequence[Regular], f: Floats) -> Bools:
    """Frequencies (F,) at which the torque has power that was not caused by the noise e through a controller.

    Elsewhere the ARX model is overconfident: without power, and in a closed loop excited only by noise, in which u and
    y show the controller, -1 / C.
    """
    own, power = np.zeros(f.size), np.zeros(f.size)
    for s in series:
        u, e, fs, length = s.u - s.u.mean(), _errors(arx, s), 1 / s.interval_s, min(_SEGMENT, s.u.size)
        at, Puu = welch(u, fs, nperseg=length)
        Pue, Pee = csd(u, e, fs, nperseg=length)[1], welch(e, fs, nperseg=length)[1]
        power += s.u.size * np.interp(f, at, Puu)
        own += s.u.size * np.interp(f, at, Puu - np.abs(Pue) ** 2 / np.maximum(Pee, 1e-300))
    # The window smears the edges of a band.
    mine = minimum_filter1d((own > _OWN * power).astype(np.int8), 3) > 0
    return np.asarray((power > _WEAK * power.max()) & mine)


def _errors(arx: Arx, s: Regular) -> Floats:
    """One step ahead (N,); zero where something is missing that they need."""
    A, B = np.concatenate([[1.0], arx.a]), np.concatenate([[0.0], arx.b])
    e = lfilter(A, [1.0], s.y) - lfilter(B, [1.0], s.u)
    lost = lfilter(np.ones(A.size + 1), [1.0], (~s.known).astype(np.float64)) > 0.5
    lost[: A.size] = True
    e = np.where(lost, 0.0, e - (e[~lost].mean() if not lost.all() else 0.0))
    return np.asarray(e, dtype=np.float64)


def _relative(arx: Arx, f: Floats) -> Floats:
    found = arx.response(f)
    return np.asarray(np.hypot(found.sd_phase, found.sd_db / DECIBEL))


# --- The response of a drive and its derivatives, by the eigenvalues of the held drive --------------------------------


# G(z) = C (zI - Ad)^-1 Bd;   with l = C (zI - Ad)^-1 and r = (zI - Ad)^-1 Bd:   dG = l dAd r + l dBd + dC r


class Response:
    """Frequency response of a problem's drive as a function of x = log theta.

    theta are the free parameters that the response depends on.

    Friction that depends on the direction and offsets have no frequency response; they stay at their start, and so do
    parameters that start at zero or below.
    """

    def __init__(self, problem: Problem, values: Mapping[str, float] | None = None) -> None:
        self.values = {**problem.nominal, **(values or {})}
        self._torque = problem.drive.of_torque
        self._delay_s = problem.delay_s
        d = AxisModel(problem.drive, self.values, ()).balance()
        self.bases = _felt(problem, self.values, d, self._torque)
        self.dampers = _dampers(problem, self.bases)
        self._structure = Structure(problem.drive, self.bases, d)

    @property
    def start(self) -> Floats:
        """x (p,) of the values that it was made with."""
        return np.log([self.values[name] for name in self.bases])

    def named(self, x: Floats) -> dict[str, float]:
        """All values at x (p,)."""
        return self.values | dict(zip(self.bases, np.exp(x).tolist(), strict=True))

    def at(self, x: Floats, target: Target) -> tuple[Complexes, Complexes]:
        """G (F,) and dG / dx (F, p).

        Raises:
            LinAlgError, ValueError: x makes no sense.
        """
        system = self._linear(x)
        n = len(system.A)
        X, dX = (part[0] for part in hold(system, np.array([target.interval_s])))
        poles, V = np.linalg.eig(X[:, :n])
        W = np.linalg.inv(V)
        through = 1 / (target.z[:, None] - poles)
        r, l = through * (W @ X[:, n]), through * (system.C @ V)
        dA, dB, dC = W @ dX[:, :, :n] @ V, dX[:, :, n] @ W.T, V.T @ system.dC
        p = len(self.bases)
        inner = (l @ dA.transpose(1, 0, 2).reshape(n, p * n)).reshape(-1, p, n)
        dG = (inner @ r[:, :, None])[..., 0] + l @ dB.T + r @ dC
        late = target.z ** (-self._delay_s / target.interval_s)
        return r @ (system.C @ V) * late, dG * np.exp(x) * late[:, None]

    def _linear(self, x: Floats) -> LinearDrive:
        system = self._structure.at(self.named(x))
        B = system.B[:, self._torque].sum(axis=1, keepdims=True)
        return system._replace(B=B, dB=system.dB[:, self._torque].sum(axis=1, keepdims=True))


def _felt(problem: Problem, values: Mapping[str, float], d: Floats, torque: np.ndarray) -> tuple[str, ...]:
    """Free parameters that A, C or the torque's column of B depend on, and that have a logarithm."""
    bases = tuple(split_name(name)[0] for name in problem.free)
    system = Structure(problem.drive, bases, d).at(values)
    moves = [
        bool(system.dA[..., i].any() or system.dB[:, torque, i].any() or system.dC[:, i].any())
        for i in range(len(bases))
    ]
    return tuple(name for name, felt in zip(bases, moves, strict=True) if felt and values[name] > 0)


def _dampers(problem: Problem, bases: tuple[str, ...]) -> Ints:
    """(pairs, 2): a damper, and the spring that joins the same inertias."""
    powers = [dict(term.powers) for term in problem.drive.terms if term.matrix == "A"]
    # What the terms of A with a parameter are divided by: the inertias on which its torque acts.
    joined = {name: {other for held in powers if name in held for other, e in held.items() if e < 0} for name in bases}
    units = {name: problem.drive.parameter(name).unit for name in bases}
    pairs = [
        (i, bases.index(spring))
        for i, damper in enumerate(bases)
        for spring in bases
        if units[damper] == DAMPING and units[spring] == STIFFNESS and joined[damper] == joined[spring]
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
