"""Frequency response from periodic excitation: means and scatter over periods, at the excited lines only.

A whole period leaks into no other line, and what differs from period to period is noise, so that its variance needs
no model (Pintelon and Schoukens, System Identification, 2nd ed., 2.4 and 4.3).  In a closed loop, whose noise is in
the torque, too, the mean over periods is as good as the reference as instrument: both keep what repeats.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.frequency import Complexes, FrequencyResponse, circular
from monitor_core.identification.record import Bools, Record
from monitor_core.identification.uniform_grid import Regular, on_grid

_BY_CHANCE = 1e-4
"""Share of the lines without excitation that pass for excited."""
_OF_LARGEST = 1e-6
"""Of the power of the strongest line: what is less is no excitation."""


class Lines(NamedTuple):
    """Of one record, at the lines k = 1 .. M/2 - 1 of its period."""

    G: Complexes
    variance: Floats  # E |dG|^2
    coherence: Floats  # of one period
    excited: Bools
    periods: int


def periodic_response(
    records: Sequence[Record] | Sequence[Regular],
    period: int,
    *,
    skip: int = 1,
    lines: Sequence[int] | None = None,
    name: str = "periods",
) -> FrequencyResponse:
    """G at the lines that every record excites; records of different phases are weighted by their variances.

    Args:
        records: with one interval; periods with a missing sample are left out.
        period: samples of one period.
        skip: periods at the start that are transient.
        lines: k of the excited frequencies k / (period h), k < period / 2; None: those that stand out of the noise
            in all records, at two periods by 40 dB, at many by 10 dB.
        name: as in a legend.

    Raises:
        ValueError: a period that is too short, fewer than two periods, no line that all records excite, or lines
            beyond the period.
    """
    if period < 4 or skip < 0:
        raise ValueError(f"period of {period} samples, {skip} skipped: need 4 at least, and none or more")
    series = on_grid(records)
    found = [_lines(record, period, skip) for record in series]
    excited = np.flatnonzero(np.logical_and.reduce([one.excited for one in found]))
    used = excited if lines is None else _given(lines, period)
    if used.size == 0:
        raise ValueError(f"no line of a period of {period} samples stands out of the noise in all records")
    weight = np.array([1 / np.maximum(one.variance[used], 1e-300) for one in found])
    G = np.sum(weight * np.array([one.G[used] for one in found]), axis=0) / weight.sum(axis=0)
    coherence = np.mean([one.coherence[used] for one in found], axis=0)
    frequency = (used + 1) / (period * series[0].interval_s)
    periods = sum(one.periods for one in found)
    return circular(frequency, G, 1 / weight.sum(axis=0), periods, name, coherence)


def _given(lines: Sequence[int], period: int) -> Ints:
    k = np.asarray(lines, dtype=np.int64)
    if not ((k >= 1) & (2 * k < period)).all():
        raise ValueError(
            f"lines from {k.min()} to {k.max()}: those of {period} samples go from 1 to {(period - 1) // 2}"
        )
    return np.unique(k) - 1


def _lines(record: Regular, M: int, skip: int) -> Lines:
    U, Y = _spectra(record, M, skip)
    P = len(U)
    u, y = U.mean(axis=0), Y.mean(axis=0)
    # Variances and covariance of the means, from the scatter of the periods.
    uu, yy = (np.sum(np.abs(Z - z) ** 2, axis=0) / (P * (P - 1)) for Z, z in ((U, u), (Y, y)))
    yu = np.sum((Y - y) * np.conj(U - u), axis=0) / (P * (P - 1))
    power = np.abs(u) ** 2
    # |u|^2 / uu of a line of noise has Fisher's distribution with 2 and 2 (P - 1) degrees of freedom.
    above = (P - 1) * (_BY_CHANCE ** (-1 / (P - 1)) - 1)
    excited = (power > above * uu) & (power > _OF_LARGEST * power.max())
    with np.errstate(divide="ignore", invalid="ignore"):
        G = y / u
        variance = (yy - 2 * np.real(np.conj(G) * yu) + np.abs(G) ** 2 * uu) / power
        coherence = np.abs(y) ** 2 / (np.abs(y) ** 2 + P * yy)
    return Lines(G, variance, coherence, excited, P)


def _spectra(record: Regular, M: int, skip: int) -> tuple[Complexes, Complexes]:
    """Of each whole period (P, lines)."""
    P = record.u.size // M
    u, y, known = (values[: P * M].reshape(P, M) for values in (record.u, record.y, record.known))
    use = known.all(axis=1) & (np.arange(P) >= skip)
    if np.count_nonzero(use) < 2:
        raise ValueError(
            f"record {record.name or '(no name)'}: {np.count_nonzero(use)} whole periods of {M} samples are left"
            f" after {skip}: their scatter needs two at least"
        )
    inside = slice(1, (M + 1) // 2)
    return np.fft.rfft(u[use], axis=1)[:, inside], np.fft.rfft(y[use], axis=1)[:, inside]
