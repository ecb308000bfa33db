"""Frequency responses with their uncertainty: one type for all methods and plots.

G is the response from the held torque to the samples of the output, G(e^{jwh}) for the interval h: what a discrete
model has, what spectra of samples estimate, and what a continuous model has after its zero-order hold.  Only these
can be compared: at a quarter of the sampling frequency the hold alone turns the phase by 45 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from monitor_core.arrays import Floats

Complexes = NDArray[np.complex128]

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

    Raises:
        ValueError: arrays of different length.
    """

    frequency_hz: Floats
    G: Complexes
    sd_db: Floats
    sd_phase: Floats
    name: str = ""

    def __post_init__(self) -> None:
        for values in (self.G, self.sd_db, self.sd_phase):
            if values.shape != self.frequency_hz.shape:
                raise ValueError(f"{values.shape} values for {self.frequency_hz.shape} frequencies")

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

    def band_db(self, sigmas: float = 2.0) -> tuple[Floats, Floats]:
        """Lower and upper limit of |G| (F,) each, dB."""
        return self.db - sigmas * self.sd_db, self.db + sigmas * self.sd_db

    def between(self, low_hz: float, high_hz: float) -> FrequencyResponse:
        """The part of it inside that band."""
        k = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        return FrequencyResponse(self.frequency_hz[k], self.G[k], self.sd_db[k], self.sd_phase[k], self.name)


def circular(frequency_hz: Floats, G: Complexes, variance: Floats, name: str = "") -> FrequencyResponse:
    """With E|dG|^2 = ``variance`` (F,), equal in all directions of the plane, as of spectra."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sd = np.sqrt(variance / 2) / np.abs(G)
    sd = np.where(np.isnan(sd), np.inf, sd)
    return FrequencyResponse(frequency_hz, G, DECIBEL * sd, sd, name)


def by_gradient(
    frequency_hz: Floats, G: Complexes, dG: Complexes, root: Floats, name: str = ""
) -> FrequencyResponse:
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
        raise ValueError(f"frequencies from {f.min():g} to {f.max():g} Hz: samples every {1e3 * interval_s:g} ms tell"
                         f" only of 0 to {0.5 / interval_s:g} Hz")  # fmt: skip
    return f, np.exp(2j * np.pi * f * interval_s)
