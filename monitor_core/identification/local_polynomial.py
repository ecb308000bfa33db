"""Frequency response by local polynomials: for sharp resonances and short records.

Without a window, the spectrum of a whole record is, exactly,  Y = G U + T + V,  where T, the transient of the record's
two ends, is as smooth in frequency as G.  So around each frequency both are polynomials, fitted by least squares to
the lines nearby; what is left is the noise.  (Pintelon, Schoukens et al., Mechanical Systems and Signal Processing 24
(2010).)  Smearing and leakage fall from the first and second to the third power of the resolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from monitor_core.arrays import Floats
from monitor_core.identification.frequency import Complexes, FrequencyResponse, circular, on_circle
from monitor_core.identification.record import Record
from monitor_core.identification.uniform_grid import Regular, on_grid

_HIDDEN = 1e-10
"""Of the strongest line of the record: polynomials told apart by less are not told at all."""


class Spectrum(NamedTuple):
    """Of one record at the lines 1 .. N/2 - 1: y, u and the instrument."""

    frequency_hz: Floats  # (F,)
    Z: Complexes  # (F, 3)


class Fit(NamedTuple):
    """At one frequency."""

    G: complex
    variance: float
    coherence: float
    freedom: int


_NOTHING = Fit(complex(np.nan, np.nan), np.inf, np.nan, 0)


def local_response(
    records: Sequence[Record] | Sequence[Regular],
    frequency_hz: ArrayLike,
    *,
    reference: str | None = None,
    lines: int = 21,
    degree: int = 2,
    name: str = "local polynomials",
) -> FrequencyResponse:
    """G at any frequencies; NaN where the lines nearby are not excited.

    Args:
        records: with one interval, without missing samples; the polynomial of G is common, transients are not.
        frequency_hz: (F,) Hz.
        reference: name of the signal that is the instrument, in closed loop; the ratio of its responses.
        lines: of the longest record, in the band around each frequency.
        degree: of the polynomials.
        name: as in a legend.

    Raises:
        ValueError: a missing sample, no such signal, too few lines, a frequency beyond half the sampling frequency.
    """
    series = on_grid(records, reference)
    if degree < 0 or lines <= 2 * (degree + 1):
        raise ValueError(
            f"{lines} lines for two polynomials of degree {degree}: need {2 * degree + 3} at least"
        )
    f, _ = on_circle(frequency_hz, series[0].interval_s)
    spectra = [_spectrum(record, reference is not None) for record in series]
    longest = max(spectra, key=lambda s: s.frequency_hz.size).frequency_hz
    if longest.size < lines:
        raise ValueError(f"{longest.size} lines in the longest record: {lines} are wanted at a time")
    fits = [_fit(spectra, _band(longest, value, lines), value, degree) for value in f.tolist()]
    G, variance, coherence, freedom = (np.array(column) for column in zip(*fits, strict=True))
    return circular(f, G, variance, freedom, name, coherence)


def _spectrum(record: Regular, with_reference: bool) -> Spectrum:
    r = record.reference if with_reference and record.reference is not None else record.u
    missing = np.count_nonzero(~(record.known & np.isfinite(r)))
    if missing:
        raise ValueError(
            f"record {record.name or '(no name)'}: {missing} samples are missing; a spectrum of the whole record"
            " needs all: cut it at the gaps, or average spectra of segments"
        )
    N = record.u.size
    inside = slice(1, (N + 1) // 2)
    z = np.array([record.y, record.u, r])
    # A spectrum without window: its noise has the same size for records of all lengths.
    Z = np.fft.rfft(z - z.mean(axis=1, keepdims=True), axis=1)[:, inside] / np.sqrt(N)
    return Spectrum(np.arange(1, (N + 1) // 2) / (N * record.interval_s), Z.T)


def _band(frequency: Floats, at: float, lines: int) -> tuple[float, float]:
    """From half a line below the first to half a line above the last of the nearest lines."""
    first = int(np.clip(np.searchsorted(frequency, at) - lines // 2, 0, frequency.size - lines))
    half = frequency[0] / 2
    return float(frequency[first] - half), float(frequency[first + lines - 1] + half)


def _fit(spectra: Sequence[Spectrum], band: tuple[float, float], at: float, degree: int) -> Fit:
    """Least squares of (y, u) on the powers of frequency times r, and on those alone for each record."""
    used = [(s, np.flatnonzero((s.frequency_hz >= band[0]) & (s.frequency_hz <= band[1]))) for s in spectra]
    used = [(s, k) for s, k in used if k.size > degree + 1]
    powers = [
        ((s.frequency_hz[k] - at) / (band[1] - band[0]))[:, None] ** np.arange(degree + 1) for s, k in used
    ]
    Z = np.vstack([s.Z[k] for s, k in used])
    X = np.vstack(powers) * Z[:, 2:]
    ends = np.cumsum([0] + [k.size for _, k in used])
    T = np.zeros((len(Z), len(used) * (degree + 1)), dtype=np.complex128)
    for j, power in enumerate(powers):
        T[ends[j] : ends[j + 1], j * (degree + 1) : (j + 1) * (degree + 1)] = power
    # Project out the transients first, so that only G remains.
    Q = np.linalg.qr(T)[0]
    X, W = X - Q @ (Q.conj().T @ X), Z[:, :2] - Q @ (Q.conj().T @ Z[:, :2])
    freedom = len(Z) - T.shape[1] - X.shape[1]
    U, sizes, Vh = np.linalg.svd(X, full_matrices=False)
    if freedom < 1 or sizes[-1] <= _HIDDEN * max(float(np.abs(s.Z[:, 2]).max()) for s, _ in used):
        return _NOTHING
    E = W - U @ (U.conj().T @ W)
    g = (Vh[:, 0].conj() / sizes) @ (U.conj().T @ W)
    spread = float(np.sum(np.abs(Vh[:, 0]) ** 2 / sizes**2)) / freedom
    return _ratio(g, E, W, spread, freedom)


def _ratio(g: Complexes, E: Complexes, W: Complexes, spread: float, freedom: int) -> Fit:
    """G = g_y / g_u, with the noise  e_y - G e_u  of the ratio."""
    G = complex(g[0] / g[1])
    v = float(np.sum(np.abs(E[:, 0] - G * E[:, 1]) ** 2))
    coherence = 1 - float(np.sum(np.abs(E[:, 0]) ** 2) / np.sum(np.abs(W[:, 0]) ** 2))
    return Fit(G, v * spread / abs(complex(g[1])) ** 2, coherence, freedom)
