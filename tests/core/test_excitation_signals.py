"""Multisines: exact power, period and band; peaks lowered without touching the spectrum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.excitation import Lines, Multisine, lines_in, multisine
from monitor_core.excitation.multisine_signals import Complex, crest_factor, flattened, log_peak_norm

WHICH: st.SearchStrategy[Lines] = st.sampled_from(["all", "odd"])


@st.composite
def multisines(draw: st.DrawFn) -> Multisine:
    N = draw(st.integers(16, 500))
    which: Lines = draw(WHICH)
    lines = lines_in(N, 0.01, (0.0, draw(st.floats(15.0, 49.0))), which)
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    amplitudes = draw(st.floats(0.1, 10.0)) * (rng.random(len(lines)) + 0.01)
    return replace(Multisine.random(rng, N, 0.01, lines), amplitudes=amplitudes)


@given(multisines())
def test_it_is_the_sum_of_cosines_that_it_says(m: Multisine) -> None:
    n = np.arange(m.N)[:, np.newaxis]
    written = (m.amplitudes * np.cos(2 * np.pi * m.lines * n / m.N + m.phases)).sum(axis=1)
    assert m.samples() == pytest.approx(written, abs=1e-9 * m.rms)
    assert np.sqrt(np.mean(m.samples() ** 2)) == pytest.approx(m.rms, rel=1e-12)


@given(multisines(), st.integers(0, 2**32))
def test_behind_a_system_every_line_is_scaled_and_turned(m: Multisine, seed: int) -> None:
    rng = np.random.default_rng(seed)
    G = rng.standard_normal(len(m.lines)) + 1j * rng.standard_normal(len(m.lines))
    before, after = (np.fft.rfft(s.samples())[m.lines] for s in (m, m.through(G)))
    assert after == pytest.approx(G * before, rel=1e-9, abs=1e-9)


def test_the_ends_of_the_band_belong_to_it() -> None:
    assert lines_in(2000, 0.005, (0.3, 30.0)).tolist() == list(range(3, 301))
    assert lines_in(2000, 0.005, (0.3, 30.0), "odd").tolist() == list(range(3, 301, 2))
    assert lines_in(400, 0.005, (10.0, 10.0)).tolist() == [20]
    assert lines_in(64, 0.005, (0.0, 1e9)).tolist() == list(range(1, 32))
    with pytest.raises(
        ValueError, match=r"2000 samples 0\.005 s apart have no line between 0\.41 and 0\.49 Hz"
    ):
        lines_in(2000, 0.005, (0.41, 0.49))


@pytest.mark.parametrize(
    ("N", "band"), [(2000, (0.0, 30.0)), (1999, (0.5, 20.0)), (400, (10.0, 10.0)), (64, (0.0, 1e9))]
)
def test_the_short_form_has_the_lines_and_the_rms_value_asked_for(
    N: int, band: tuple[float, float], seed: int
) -> None:
    x = multisine(np.random.default_rng(seed), N, 0.005, band, 1.23)
    assert np.sqrt(np.mean(x**2)) == pytest.approx(1.23, rel=1e-12)
    spectrum, lines = np.abs(np.fft.rfft(x)), lines_in(N, 0.005, band)
    assert spectrum[lines] == pytest.approx(spectrum[lines[0]], rel=1e-9)
    assert np.delete(spectrum, lines) == pytest.approx(0.0, abs=1e-9)


def test_phases_are_uniform_and_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = (multisine(rng, 2000, 0.005, (0.0, 90.0), 1.0) for _ in range(2))
    assert abs(np.mean(first * second)) < 0.2
    phase = np.angle(np.fft.rfft(first)[1:901])
    # The mean of 900 unit vectors of uniform phase is longer than 0.15 once in a billion.
    assert abs(np.exp(1j * phase).mean()) < 0.15
    assert abs(np.exp(2j * phase).mean()) < 0.15


@pytest.mark.parametrize("which", ["all", "odd"])
def test_peaks_become_lower_than_schroeders_and_the_spectrum_stays(which: Lines, seed: int) -> None:
    lines = lines_in(2000, 0.005, (0.0, 30.0), which)
    m = Multisine.random(np.random.default_rng(seed), 2000, 0.005, lines)
    flat = flattened(m)
    assert flat.amplitudes is m.amplitudes
    assert crest_factor(flat.samples()) < 1.45
    assert crest_factor(m.samples()) > 2.0
    assert 1.55 < crest_factor(m.with_schroeder_phases().samples()) < 1.85


def test_schroeders_phases_suit_any_spectrum(seed: int) -> None:
    lines = lines_in(4000, 0.005, (0.0, 30.0))
    m = Multisine.random(np.random.default_rng(seed), 4000, 0.005, lines)
    m = replace(m, amplitudes=1 / np.sqrt(np.arange(10, 10 + len(lines))))
    assert crest_factor(m.with_schroeder_phases().samples()) < 2.2 < crest_factor(m.samples())


def test_schroeders_phases_of_equal_lines() -> None:
    """As he writes them: -pi k (k - 1) / L."""
    m = Multisine(64, 0.01, np.arange(1, 11), np.full(10, 0.7), np.zeros(10))
    k = np.arange(1, 11)
    assert m.with_schroeder_phases().phases == pytest.approx(-np.pi * k * (k - 1) / 10, abs=1e-12)


@given(multisines(), st.sampled_from([1, 2, 8, 64]), st.integers(0, 2**32))
def test_slopes_of_the_norm_of_several_signals(m: Multisine, p: int, seed: int) -> None:
    """Against differences, in a random direction."""
    rng = np.random.default_rng(seed)
    gains: Complex = m.amplitudes * (1 + rng.random((2, 1)) * np.exp(2j * np.pi * rng.random(len(m.lines))))
    direction, h = rng.standard_normal(len(m.lines)), 1e-5
    ends = [log_peak_norm(m.phases + sign * h * direction, gains, m.lines, m.N, p)[0] for sign in (1, -1)]
    _, slopes = log_peak_norm(m.phases, gains, m.lines, m.N, p)
    tolerance = 1e-6 * p * float(np.linalg.norm(direction))
    assert slopes @ direction == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=tolerance)


def test_the_largest_of_several_signals_counts(seed: int) -> None:
    """Each over its limit: the second is an integral of the first, and has room or not."""
    lines = lines_in(1000, 0.01, (0.0, 20.0))
    m = Multisine.random(np.random.default_rng(seed), 1000, 0.01, lines)
    integral: Complex = 1 / (2j * np.pi * m.frequency_hz)

    def peak_of_integral(share: float) -> float:
        flat = flattened(m, [np.ones(len(lines), complex), share * integral])
        return crest_factor(flat.through(integral).samples())

    tight, loose = peak_of_integral(1e3), peak_of_integral(1e-3)
    assert tight < 0.9 * loose


def test_a_sine_stays_a_sine() -> None:
    m = Multisine(100, 0.01, np.array([3]), np.array([2.0]), np.array([0.3]))
    assert flattened(m).amplitudes is m.amplitudes
    assert crest_factor(m.samples()) == pytest.approx(np.sqrt(2), rel=1e-2)
