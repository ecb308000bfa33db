"""Frequency responses with their uncertainty: one type for all methods and plots; estimates from spectra of records.

G is the response from the held torque to the samples of the output, G(e^{jwh}) for the interval h.  This is the
response of a discrete model, of spectra of samples, and of a continuous model with zero-order hold.  Without the hold,
responses could not be compared: at a quarter of the sampling frequency the hold alone turns the phase by 45 degrees.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from monitor_core.arrays import Complexes, Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.uniform_grid import Regular, on_grid, stretches

DECIBEL = 20 / np.log(10)
"""dB of one neper: a relative error of 1 % of |G| is 0.087 dB."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """A frequency response at F frequencies.

    Args:
        frequency_hz: (F,) Hz.
        G: (F,) complex, rad/s (or rad) per N m.
        sd_db: (F,) standard deviation of 20 log10 |G|, dB; infinite: not known at all.
        sd_phase: (F,) standard deviation of the phase, rad.
        name: as in a legend.
    """

    frequency_hz: Floats
    G: Complexes
    sd_db: Floats
    sd_phase: Floats
    name: str = ""

    @property
    def db(self) -> Floats:
        """(F,) 20 log10 |G|."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(np.abs(self.G)))

    @property
    def phase(self) -> Floats:
        """(F,) rad, without jumps of a full turn; NaN where G is."""
        phase = np.angle(self.G)
        good = np.isfinite(phase)
        phase[good] = np.unwrap(phase[good])
        return phase

    def band_db(self, sigmas: float) -> tuple[Floats, Floats]:
        """Lower and upper limit of |G| (F,) each, dB."""
        return self.db - sigmas * self.sd_db, self.db + sigmas * self.sd_db


def by_gradient(frequency_hz: Floats, G: Complexes, dG: Complexes, root: Floats, name: str = "") -> FrequencyResponse:
    """The delta method:  d log G = sum_i (dG/dtheta_i / G) dtheta_i,  real part the gain, imaginary part the phase.

    dG (F, p) are the derivatives with respect to theta, and root (p, r) has root root' the covariance of theta.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        w = (dG / G[:, None]) @ root
    gain, phase = np.linalg.norm(w.real, axis=1), np.linalg.norm(w.imag, axis=1)
    return FrequencyResponse(frequency_hz, G, DECIBEL * gain, phase, name)


def root_of(covariance: Floats) -> Floats:
    """root (p, p) with root root' = covariance, which may be singular; rounding below zero counts as zero."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=np.float64))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def on_circle(frequency_hz: ArrayLike, interval_s: float) -> tuple[Floats, Complexes]:
    """The frequencies (F,) as an array, and z = e^{jwh} (F,).

    Raises:
        ValueError: a frequency that is not between zero and half the sampling frequency.
    """
    f = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    # The last bit of a grid that ends at the Nyquist frequency does not matter.
    if not ((f >= 0) & (f <= 0.5 / interval_s * (1 + 1e-9))).all():
        raise ValueError(f"frequencies from {f.min():g} to {f.max():g} Hz: samples every {1e3 * interval_s:g} ms show"
                         f" only 0 to {0.5 / interval_s:g} Hz")  # fmt: skip
    return f, np.exp(2j * np.pi * f * interval_s)


# --- From any excitation: local polynomials ---------------------------------------------------------------------------


# In a narrow band G is a polynomial of the frequency, and so is the transient that the motion before and after a
# stretch of samples leaves in its spectrum (Pintelon and Schoukens, System Identification, 2nd ed., ch. 7).

_LINES, _DEGREE = 21, 2
"""Lines of the longest stretch in the band around each frequency, and degree of the polynomials there."""
_HIDDEN = 1e-10
"""Polynomials that differ by less than this share of the strongest line are not determined."""


class Spectrum(NamedTuple):
    """Spectrum of N samples, none of which is missing, at the lines 1 .. N/2 - 1."""

    frequency_hz: Floats  # (F,)
    y: Complexes  # (F,)
    u: Complexes  # (F,)


def local_response(records: Sequence[Record] | Sequence[Regular], frequency_hz: ArrayLike) -> FrequencyResponse:
    """G at any frequencies (F,); NaN where the lines nearby are not excited.

    The records have one interval.  The polynomial of G is common, each stretch without a missing sample has its own
    transient.

    Raises:
        ValueError: too few lines, a frequency beyond half the sampling frequency.
    """
    series = on_grid(records)
    f, _ = on_circle(frequency_hz, series[0].interval_s)
    spectra = [_spectrum(record, a, b) for record in series for a, b in stretches(record.known)]
    longest = max((s.frequency_hz for s in spectra), key=len, default=np.empty(0))
    if longest.size < _LINES:
        raise ValueError(
            f"{longest.size} lines in the longest stretch without a missing sample: at least {_LINES} are needed"
        )
    fits = [_fit(spectra, _band(longest, value), value) for value in f.tolist()]
    G, variance = (np.array(column) for column in zip(*fits, strict=True))
    # The variance is that of |dG|, equal in all directions of the plane.
    with np.errstate(divide="ignore", invalid="ignore"):
        sd = np.sqrt(variance / 2) / np.abs(G)
    sd = np.where(np.isnan(sd), np.inf, sd)
    return FrequencyResponse(f, G, DECIBEL * sd, sd, "record, local polynomials")


def _spectrum(record: Regular, a: int, b: int) -> Spectrum:
    """Spectrum of the samples a .. b-1 of a record."""
    N = b - a
    z = np.array([record.y[a:b], record.u[a:b]])
    # A spectrum without window: its noise has the same size for stretches of all lengths.
    y, u = np.fft.rfft(z - z.mean(axis=1, keepdims=True), axis=1)[:, 1 : (N + 1) // 2] / np.sqrt(N)
    return Spectrum(np.arange(1, (N + 1) // 2) / (N * record.interval_s), y, u)


def _band(frequency: Floats, at: float) -> tuple[float, float]:
    """From half a line below the first to half a line above the last of the nearest lines."""
    first = int(np.clip(np.searchsorted(frequency, at) - _LINES // 2, 0, frequency.size - _LINES))
    half = frequency[0] / 2
    return float(frequency[first] - half), float(frequency[first + _LINES - 1] + half)


def _fit(spectra: Sequence[Spectrum], band: tuple[float, float], at: float) -> tuple[complex, float]:
    """G and its variance: y on the powers of frequency times u, and on those alone for each stretch."""
    used = [(s, np.flatnonzero((s.frequency_hz >= band[0]) & (s.frequency_hz <= band[1]))) for s in spectra]
    used = [(s, k) for s, k in used if k.size > _DEGREE + 1]
    powers = [((s.frequency_hz[k] - at) / (band[1] - band[0]))[:, None] ** np.arange(_DEGREE + 1) for s, k in used]
    y, u = np.concatenate([s.y[k] for s, k in used]), np.concatenate([s.u[k] for s, k in used])
    X, T = np.vstack(powers) * u[:, None], block_diag(*powers)
    # Project out the transients first, so that only G remains.
    Q = np.linalg.qr(T)[0]
    X, y = X - Q @ (Q.conj().T @ X), y - Q @ (Q.conj().T @ y)
    freedom = y.size - T.shape[1] - X.shape[1]
    U, sizes, Vh = np.linalg.svd(X, full_matrices=False)
    if freedom < 1 or sizes[-1] <= _HIDDEN * max(float(np.abs(s.u).max()) for s, _ in used):
        return complex(np.nan, np.nan), np.inf
    along = U.conj().T @ y
    noise = float(np.sum(np.abs(y - U @ along) ** 2)) / freedom
    spread = float(np.sum(np.abs(Vh[:, 0]) ** 2 / sizes**2))
    return complex((Vh[:, 0].conj() / sizes) @ along), noise * spread
