"""Frequency responses: local polynomials against systems whose response is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import csd, welch

from monitor_core.arrays import Complexes
from monitor_core.excitation import multisine
from monitor_core.identification import Record
from monitor_core.identification.black_boxes.frequency_response import (
    DECIBEL,
    FrequencyResponse,
    local_response,
)
from tests.core.identification.systems import (
    INTERVAL_S,
    bench_drive,
    decibels,
    innovations_record,
    small_drive,
    times,
)

law = settings(deadline=None, max_examples=8)
seeds = st.integers(0, 2**32 - 1)
LOOP = 0.4
"""Feedback of y."""
M = 400
"""Samples of a period."""


def by_local(record: Record) -> FrequencyResponse:
    return local_response([record], np.arange(2.0, 90.0, 4.0))


def white(rng: np.random.Generator, N: int, sd: float, feedback: float = 0.0) -> Record:
    drive, K = small_drive()
    return innovations_record(rng, drive, K, rng.normal(size=N), sd, feedback)


def repeated(rng: np.random.Generator, periods: int, sd: float, feedback: float = 0.0) -> Record:
    drive, K = small_drive()
    u = np.tile(multisine(rng, M, INTERVAL_S, (1.0, 60.0), 1.0), periods)
    return innovations_record(rng, drive, K, u, sd, feedback)


def log_errors(response: FrequencyResponse) -> Complexes:
    """Relative errors in units of the deviation that is stated, gain and phase."""
    w = np.log(response.G / small_drive()[0].response(response.frequency_hz))
    gain, phase = DECIBEL * w.real / response.sd_db, w.imag / response.sd_phase
    return np.asarray(gain + 1j * phase)


# --- coverage ---------------------------------------------------------------------------------------------


def test_deviations_cover(seed: int) -> None:
    """100 records: 80 % of the errors within 1.28 stated deviations, of the phases 77 +- 1.1 %."""
    rng = np.random.default_rng(seed)
    errors = np.concatenate([log_errors(by_local(white(rng, 4000, 0.5))) for _ in range(100)])
    assert errors.size > 2000
    for part in (errors.real, errors.imag):
        assert np.mean(abs(part) < 1.2816) == pytest.approx(0.80, abs=0.06)


def test_without_noise_it_is_right(seed: int) -> None:
    """In a closed loop, too; what is left is a small smearing."""
    response = by_local(white(np.random.default_rng(seed), 8000, 0.0, LOOP))
    truth = small_drive()[0].response(response.frequency_hz)
    assert np.median(abs(decibels(response.G, truth))) < 1e-3


def test_a_sharp_resonance_is_followed(seed: int) -> None:
    """The bench drive, resonances 1.6 and 5 Hz wide, 12 records of 20 s: errors some 0.62 +- 0.07 those of spectra.

    The spectra are averaged over segments of 2.5 s by scipy.
    """
    rng, drive = np.random.default_rng(seed), bench_drive()
    errors = []
    for _ in range(12):
        u = rng.normal(size=4000)
        record = Record(times(4000), u, drive.simulate(u) + 0.05 * rng.normal(size=4000), "speed")
        f, Suy = csd(u, record.y, 1 / INTERVAL_S, nperseg=500)
        inside = (f >= 2.0) & (f <= 40.0)
        f, spectra = f[inside], (Suy / welch(u, 1 / INTERVAL_S, nperseg=500)[1])[inside]
        both = spectra, local_response([record], f).G
        errors.append([np.mean(decibels(G, drive.response(f)) ** 2) for G in both])
    spectra_error, local_error = np.sqrt(np.mean(errors, axis=0))
    assert local_error < 0.85 * spectra_error


# --- laws --------------------------------------------------------------------------------------------------


@law
@given(seeds, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(-50, 50))
def test_units_and_offsets_change_the_gain_only(seed: int, of_u: float, of_y: float, offset: float) -> None:
    record = repeated(np.random.default_rng(seed), 5, 0.3, LOOP)
    other = Record(record.t, of_u * record.u - offset, of_y * record.y + offset, "speed")
    original, converted = by_local(record), by_local(other)
    good = np.isfinite(original.G) & (original.frequency_hz < 60)
    assert good.any()
    assert converted.G[good] * of_u / of_y == pytest.approx(original.G[good], rel=1e-4)
    # Where a line repeats itself exactly the deviation is what rounding leaves.
    assert converted.sd_db[good] == pytest.approx(original.sd_db[good], rel=1e-3, abs=1e-6)


def test_four_records_halve_the_deviations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    records = [white(rng, 4000, 0.5) for _ in range(4)]
    single, four = (local_response(part, np.arange(2.0, 60.0, 1.0)) for part in (records[:1], records))
    assert np.median(single.sd_db) / np.median(four.sd_db) == pytest.approx(2.0, rel=0.2)
    z = log_errors(four)
    assert np.mean(abs(z) ** 2) == pytest.approx(2.0, rel=0.6)


def test_a_gap_makes_two_records(seed: int) -> None:
    record = white(np.random.default_rng(seed), 4000, 0.3)
    found = by_local(record.without(slice(2000, 2005)))
    two = local_response([record.select(slice(0, 2000)), record.select(slice(2005, 4000))], found.frequency_hz)
    np.testing.assert_allclose(found.G, two.G, rtol=1e-9)
    np.testing.assert_allclose(found.sd_db, two.sd_db, rtol=1e-9)


def test_deviations_cover_where_samples_are_missing(seed: int) -> None:
    """One in 300 of 40 records; each stretch between them has a transient of its own."""
    rng = np.random.default_rng(seed)
    records = [white(rng, 4000, 0.5).without(rng.random(4000) < 1 / 300) for _ in range(40)]
    errors = [log_errors(by_local(record)) for record in records]
    for part in (np.real(errors), np.imag(errors)):
        assert np.mean(abs(part) < 1.2816) == pytest.approx(0.80, abs=0.08)


def test_lines_without_excitation_are_not_estimated(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = multisine(rng, 2000, INTERVAL_S, (1.0, 30.0), 1.0)
    local = local_response([Record(times(2000), u, np.roll(u, 1), "speed")], [10.0, 70.0])
    assert np.isfinite(local.G).tolist() == [True, False]
    assert np.isinf(local.sd_db).tolist() == [False, True]


def test_mistakes_are_told(seed: int) -> None:
    record = white(np.random.default_rng(seed), 500, 0.1)
    for short in (record.select(slice(0, 40)), record.without(slice(40, None, 41))):
        with pytest.raises(ValueError, match=r"19 lines in the longest stretch .*: at least 21 are needed"):
            local_response([short], [1.0])
    with pytest.raises(ValueError, match="0 lines"):
        local_response([record.without(slice(None))], [1.0])
