"""Excitation signals."""

import numpy as np

from monitor_core.kernel.tables import Floats


def multisine(
    rng: np.random.Generator, N: int, interval_s: float, band_hz: tuple[float, float], rms: float
) -> Floats:
    """Random-phase multisine (N,): a sine of equal size at every line of the DFT grid inside the band.

    The lines are k / (N interval_s), so the signal is periodic with N samples and leaks into no other line;
    the constant and the Nyquist frequency are left out.  The phases are uniform; the rms value is exact.

    Raises:
        ValueError: no line of the grid lies inside the band.
    """
    low, high = band_hz
    lines = np.arange(1, (N + 1) // 2)
    frequency = lines / (N * interval_s)
    # The ends of the band belong to it, whatever the last bit of the quotient.
    inside = lines[(frequency >= low * (1 - 1e-9)) & (frequency <= high * (1 + 1e-9))]
    if inside.size == 0:
        raise ValueError(f"{N} samples {interval_s} s apart have no line between {low} and {high} Hz")
    spectrum = np.zeros(N // 2 + 1, dtype=complex)
    spectrum[inside] = np.exp(2j * np.pi * rng.random(inside.size))
    # A line of size 1 is a sine of amplitude 2 / N.
    return np.asarray(np.fft.irfft(spectrum, N) * (rms * N / np.sqrt(2 * inside.size)))
