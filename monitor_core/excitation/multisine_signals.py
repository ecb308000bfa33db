"""Sums of sines on the lines of a DFT grid: periodic, without leakage, with any spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats

Complex = NDArray[np.complexfloating[Any, Any]]
Lines = Literal["all", "odd"]
"""With odd lines only, the second half of a period is minus the first, so that the effect of friction has no mean."""


def lines_in(N: int, interval_s: float, band_hz: tuple[float, float], which: Lines = "all") -> NDArray[np.intp]:
    """The lines k (L,), of frequency k / (N interval_s), inside the band, its ends included.

    The constant and the Nyquist frequency are left out.

    Raises:
        ValueError: there is none.
    """
    low, high = band_hz
    lines = np.arange(1, (N + 1) // 2, 1 if which == "all" else 2)
    frequency = lines / (N * interval_s)
    # Independent of the last bit of the quotient.
    inside = lines[(frequency >= low * (1 - 1e-9)) & (frequency <= high * (1 + 1e-9))]
    if inside.size == 0:
        raise ValueError(f"{N} samples {interval_s} s apart have no line between {low} and {high} Hz")
    return inside


@dataclass(frozen=True)
class Multisine:
    """One period of  x[n] = sum_k a_k cos(2 pi k n / N + phase_k),  n = 0 .. N-1, held or sampled interval_s apart.

    Args:
        N: samples in a period.
        interval_s: between two of them.
        lines: k (L,), between the constant and the Nyquist frequency.
        amplitudes: a_k (L,), not negative.
        phases: (L,), rad.
    """

    N: int
    interval_s: float
    lines: NDArray[np.intp]
    amplitudes: Floats
    phases: Floats

    @classmethod
    def random(cls, rng: np.random.Generator, N: int, interval_s: float, lines: NDArray[np.intp]) -> Multisine:
        """A multisine with equal amplitudes and uniform phases, rms value 1."""
        amplitudes = np.full(len(lines), np.sqrt(2 / len(lines)))
        return cls(N, interval_s, lines, amplitudes, 2 * np.pi * rng.random(len(lines)))

    @property
    def frequency_hz(self) -> Floats:
        """Frequency of each line (L,), Hz."""
        return np.asarray(self.lines / (self.N * self.interval_s))

    @property
    def rms(self) -> float:
        """Root mean square."""
        return float(np.sqrt(np.sum(self.amplitudes**2) / 2))

    def samples(self) -> Floats:
        """One period (N,)."""
        (period,) = _signals((self.amplitudes * np.exp(1j * self.phases))[np.newaxis], self.lines, self.N)
        return np.asarray(period)

    def times(self, factor: float) -> Multisine:
        """The signal scaled by a factor."""
        return replace(self, amplitudes=self.amplitudes * factor)

    def through(self, response: Complex) -> Multisine:
        """Steady-state response of a linear system with this frequency response (L,)."""
        return replace(self, amplitudes=self.amplitudes * np.abs(response), phases=self.phases + np.angle(response))


def multisine(rng: np.random.Generator, N: int, interval_s: float, band_hz: tuple[float, float], rms: float) -> Floats:
    """Random-phase multisine (N,): a sine of equal size at every line of the DFT grid inside the band.

    The lines are k / (N interval_s), so the signal is periodic with N samples and leaks into no other line; the
    constant and the Nyquist frequency are left out.  The phases are uniform; the rms value is exact.

    Raises:
        ValueError: no line of the grid lies inside the band.
    """
    lines = lines_in(N, interval_s, band_hz)
    return Multisine.random(rng, N, interval_s, lines).times(rms).samples()


# --- Crest factors: with low peaks a multisine has more power within the same limits, and so determines more ----------


# P. Guillaume, J. Schoukens, R. Pintelon, I. Kollar, "Crest-factor minimization using nonlinear Chebyshev approximation
# methods", IEEE Trans. Instrumentation and Measurement 40 (1991): the l_2p norm for growing p, over the phases; several
# signals at once.  Here the gradient comes from one Fourier transform, and L-BFGS goes down it.

_EXPONENTS = (2, 4, 8, 16, 32, 64, 128)
_STEPS = 100
"""Steps of L-BFGS for each exponent."""
_OVERSAMPLING = 16
"""Samples in a period of the highest line, with which peaks between samples can be neglected."""


def crest_factor(x: Floats) -> float:
    """Largest absolute value over root mean square: 1.41 of a sine, about 3 to 4 of random phases."""
    return float(np.abs(x).max() / np.sqrt(np.mean(x**2)))


def flattened(signal: Multisine, weights: Sequence[Complex] = ()) -> Multisine:
    """The same lines and amplitudes, with phases that minimise the largest peak.

    Args:
        signal: its phases are the start.
        weights: frequency responses (L,) from the signal to every limited quantity, each over its limit; default the
            signal itself.
    """
    from scipy.optimize import minimize  # 16 MB, which the daemon does not need

    grid = min(signal.N, max(_OVERSAMPLING * int(signal.lines.max()), 64))
    rows = [np.asarray(w, dtype=complex) for w in weights] or [np.ones(len(signal.lines), dtype=complex)]
    gains: Complex = np.array([row * signal.amplitudes for row in rows])
    phases = signal.phases
    for p in _EXPONENTS:
        found = minimize(
            log_peak_norm,
            phases,
            args=(gains, signal.lines, grid, p),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _STEPS, "maxcor": 20},
        )
        phases = np.asarray(found.x)
    better = replace(signal, phases=phases)
    return better if _peak(better, gains) < _peak(signal, gains) else signal


def log_peak_norm(phases: Floats, gains: Complex, lines: NDArray[np.intp], N: int, p: int) -> tuple[float, Floats]:
    """log of the l_2p norm of all signals (J, N) together, and its slopes (L,)."""
    c = gains * np.exp(1j * phases)
    x = _signals(c, lines, N)
    top = np.abs(x).max()
    y = x / top
    total = np.sum(y ** (2 * p))
    slope = np.fft.rfft(y ** (2 * p - 1), axis=1)[:, lines] / (total * top)
    return float(np.log(total) / (2 * p) + np.log(top)), np.real(1j * c * np.conj(slope)).sum(axis=0)


def _signals(c: Complex, lines: NDArray[np.intp], N: int) -> Floats:
    """Samples (J, N) of signals with complex amplitudes c (J, L) at the lines (L,)."""
    spectrum = np.zeros((len(c), N // 2 + 1), dtype=complex)
    spectrum[:, lines] = c
    return np.asarray(np.fft.irfft(spectrum, N, axis=1) * (N / 2))


def _peak(signal: Multisine, gains: Complex) -> float:
    return float(np.abs(_signals(gains * np.exp(1j * signal.phases), signal.lines, signal.N)).max())
