"""Crest factors: a multisine whose peaks are low for its power tells more within the same limits.

P. Guillaume, J. Schoukens, R. Pintelon, I. Kollar, "Crest-factor minimization using nonlinear Chebyshev approximation
methods", IEEE Trans. Instrumentation and Measurement 40 (1991): the l_2p norm for growing p, over the phases; several
signals at once.  Here the gradient comes from one Fourier transform, and L-BFGS goes down it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from monitor_core.arrays import Floats
from monitor_core.excitation.multisine import Complex, Multisine

_EXPONENTS = (2, 4, 8, 16, 32, 64, 128)
_STEPS = 100
"""Of L-BFGS, for each exponent."""
_OVERSAMPLING = 16
"""Samples in a period of the highest line, from which on a peak between two of them does not count."""


def crest_factor(x: Floats) -> float:
    """Largest absolute value over root mean square: 1.41 of a sine, about 3 to 4 of random phases."""
    return float(np.abs(x).max() / np.sqrt(np.mean(x**2)))


def flattened(signal: Multisine, weights: Sequence[Complex] = ()) -> Multisine:
    """The same lines and amplitudes, with the phases that make the largest peak small.

    Args:
        signal: its phases are the start.
        weights: frequency responses (L,) from the signal to everything that has a limit, each over its limit; default
            the signal itself.
    """
    grid = min(signal.N, max(_OVERSAMPLING * int(signal.lines.max()), 64))
    rows = [np.asarray(w, dtype=complex) for w in weights] or [np.ones(len(signal.lines), dtype=complex)]
    gains: Complex = np.array([row * signal.amplitudes for row in rows])
    phases = signal.phases
    for p in _EXPONENTS:
        found = minimize(
            _log_norm,
            phases,
            args=(gains, signal.lines, grid, p),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _STEPS, "maxcor": 20},
        )
        phases = np.asarray(found.x)
    better = replace(signal, phases=phases)
    return better if _peak(better, gains) < _peak(signal, gains) else signal


def _log_norm(
    phases: Floats, gains: Complex, lines: NDArray[np.intp], N: int, p: int
) -> tuple[float, Floats]:
    """log of the l_2p norm of all signals (J, N) together, and its slopes (L,)."""
    c = gains * np.exp(1j * phases)
    x = _signals(c, lines, N)
    top = np.abs(x).max()
    y = x / top
    total = np.sum(y ** (2 * p))
    slope = np.fft.rfft(y ** (2 * p - 1), axis=1)[:, lines] / (total * top)
    return float(np.log(total) / (2 * p) + np.log(top)), np.real(1j * c * np.conj(slope)).sum(axis=0)


def _signals(c: Complex, lines: NDArray[np.intp], N: int) -> Floats:
    spectrum = np.zeros((len(c), N // 2 + 1), dtype=complex)
    spectrum[:, lines] = c
    return np.asarray(np.fft.irfft(spectrum, N, axis=1) * (N / 2))


def _peak(signal: Multisine, gains: Complex) -> float:
    return float(np.abs(_signals(gains * np.exp(1j * signal.phases), signal.lines, signal.N)).max())
