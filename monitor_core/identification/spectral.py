"""Frequency response from any excitation: averaged spectra, with coherence; in closed loop by an instrument.

    open loop      G = S_yu / S_uu            biased where noise comes back through the loop
    closed loop    G = S_yr / S_ur            r: the reference, which the noise knows nothing of

Welch's segments with Hann's window (Ljung, System Identification, 2nd ed., 6.4 and 13.4).  A resonance narrower than
the window, 1.5 / (segment h), is smeared: local polynomials (local_polynomial.py) are better there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.signal.windows import hann

from monitor_core.arrays import Floats
from monitor_core.identification.frequency import Complexes, FrequencyResponse, circular
from monitor_core.identification.record import Record
from monitor_core.identification.uniform_grid import Regular, on_grid


def spectral_response(
    records: Sequence[Record] | Sequence[Regular],
    segment: int | None = None,
    *,
    reference: str | None = None,
    name: str = "spectra",
) -> FrequencyResponse:
    """G at the lines of a segment, without the constant and the Nyquist frequency.

    Args:
        records: with one interval; segments with a missing sample are left out.
        segment: samples of a segment, of which the next one shares half; default: an eighth of the longest record.
        reference: name of the signal that is the instrument.
        name: as in a legend.

    Raises:
        ValueError: no such signal, segments that are too short, or fewer than two of them.
    """
    series = on_grid(records, reference)
    L = segment or max(record.u.size for record in series) // 8
    if L < 8:
        raise ValueError(f"segments of {L} samples: 8 at least are needed")
    window = hann(L, sym=False)
    Z = np.array([np.fft.rfft(window * part, axis=1) for part in _segments(series, L, reference is not None)])
    if len(Z) < 2:
        raise ValueError(f"{len(Z)} segments of {L} samples without a missing one: two at least are needed")
    S = np.einsum("kaf,kbf->fab", Z, np.conj(Z))[1 : (L + 1) // 2] / len(Z)
    n = len(Z) / _redundancy(window, len(Z))
    frequency = np.arange(1, (L + 1) // 2) / (L * series[0].interval_s)
    G, variance, coherence = _ratio(S, n)
    return circular(frequency, G, variance, n, name, coherence)


def _segments(series: Sequence[Regular], L: int, with_reference: bool) -> Iterator[Floats]:
    """y, u and the instrument, u itself if there is no other: (3, L), less their means."""
    for record in series:
        r = record.reference if with_reference and record.reference is not None else record.u
        known = record.known & np.isfinite(r)
        for start in range(0, record.u.size - L + 1, L // 2):
            part = slice(start, start + L)
            if known[part].all():
                z = np.array([record.y[part], record.u[part], r[part]])
                yield z - z.mean(axis=1, keepdims=True)


def _redundancy(window: Floats, K: int) -> float:
    """Variance of a mean of K segments over that of K independent ones; neighbours correlate by rho^2."""
    half = window.size // 2
    rho = float(window[half:] @ window[: window.size - half] / (window @ window))
    return 1 + 2 * rho**2 * (K - 1) / K


def _ratio(S: Complexes, n: float) -> tuple[Complexes, Floats, Floats]:
    """G, E |dG|^2 and the coherence of y and the instrument, from S (F, 3, 3) of y, u and r in n averages."""
    Syr, Sur, Srr = S[:, 0, 2], S[:, 1, 2], S[:, 2, 2].real
    with np.errstate(divide="ignore", invalid="ignore"):
        G = Syr / Sur
        v = S[:, 0, 0].real - 2 * np.real(np.conj(G) * S[:, 0, 1]) + np.abs(G) ** 2 * S[:, 1, 1].real
        variance = np.maximum(v, 0.0) * Srr / np.abs(Sur) ** 2 / (n - 1)
        coherence = np.abs(Syr) ** 2 / (S[:, 0, 0].real * Srr)
    return G, variance, coherence
