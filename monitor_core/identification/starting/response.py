"""The frequency response of the records, reduced to a hundred points, on the unit circle and outside of it.

A simulation of the whole record takes a hundred times as long as the response of a model at a hundred frequencies.  So
starting values are found from the response of an ARX model of high order, with its uncertainty.

Outside of the unit circle, at z = exp((sigma + j w) h), the response is that of signals weighted with exp(-sigma t):
every resonance appears damped by sigma more.  There the peaks of a model that is far off still overlap with those of
the record, which guides a search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d
from scipy.signal import csd, lfilter, medfilt, welch

from monitor_core.arrays import Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.arx import Arx, fit_arx
from monitor_core.identification.frequency import DECIBEL, Complexes
from monitor_core.identification.record import Bools, Record
from monitor_core.identification.resampling import resample
from monitor_core.identification.uniform_grid import Regular, on_grid

_ORDER = 100
"""Of the ARX model: half a second of memory at 5 ms."""
_ROWS = 20
"""Samples for each of its orders, at least."""
_POINTS = 100
_SURE = 0.5
"""Relative standard deviation from which on the response counts as unknown."""
_WEAK = 1e-4
"""Spectral density of the torque, as part of the largest, below which it excites nothing."""
_OWN = 0.3
"""Part of the torque's power that must come from elsewhere than from the noise of the record itself."""
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
    """The response in the records.

    Args:
        series: the records on a grid.
        output: the measured quantity.
        arx: source of the response.
        frequency_hz: (F,) where it is known.
        sd: (F,) standard deviation of its relative error, |dG| / |G|.
        expected: sum of squares of relative errors over ``sd`` of the right model: the number of parameters of the ARX
            model in that band.
    """

    series: tuple[Regular, ...]
    output: Output
    arx: Arx
    frequency_hz: Floats
    sd: Floats
    expected: float

    def target(self, shift: float = 0.0, surest: float = 0.0) -> Target:
        """The points at exp((shift + j w) h), ``shift`` in 1/s; none counts as surer than ``surest``."""
        z = np.exp((shift + 2j * np.pi * self.frequency_hz) * self.arx.interval_s)
        return Target(z, rational(self.arx, z), 1 / np.maximum(self.sd, surest), self.arx.interval_s)


def rational(arx: Arx, z: Complexes) -> Complexes:
    """B / A (F,) at any z (F,)."""
    past = 1 / z[:, None]
    A = 1 + past ** np.arange(1, arx.a.size + 1) @ arx.a
    B = past ** (arx.delay + np.arange(arx.b.size)) @ arx.b
    return np.asarray(B / A, dtype=np.complex128)


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
    known = wide[_longest(sure)]
    if known.size < 5:
        raise ValueError("the records do not tell a frequency response: the torque hardly moves the axis, or all that"
                         " was measured is noise")  # fmt: skip
    f = np.linspace(known[0], known[-1], _POINTS)
    sd = _relative(arx, f)
    f, sd = f[sd < _SURE], sd[sd < _SURE]
    band = f.size / _POINTS * (known[-1] - known[0]) / nyquist
    return Measured(series, records[0].quantity, arx, f, sd, 2 * arx.a.size * float(min(band, 1.0)))


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
    return on_grid([resample(record, interval).record for record in records])


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
    A, B = np.concatenate([[1.0], arx.a]), np.concatenate([np.zeros(arx.delay), arx.b])
    e = lfilter(A, [1.0], s.y) - lfilter(B, [1.0], s.u)
    lost = lfilter(np.ones(A.size + 1), [1.0], (~s.known).astype(np.float64)) > 0.5
    lost[: A.size] = True
    e = np.where(lost, 0.0, e - (e[~lost].mean() if not lost.all() else 0.0))
    return np.asarray(e, dtype=np.float64)


def _longest(good: Bools) -> slice:
    """The longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]])))
    first, end = edges[::2], edges[1::2]
    if not first.size:
        return slice(0, 0)
    k = int(np.argmax(end - first))
    return slice(int(first[k]), int(end[k]))


def _relative(arx: Arx, f: Floats) -> Floats:
    found = arx.response(f)
    return np.asarray(np.hypot(found.sd_phase, found.sd_db / DECIBEL))
