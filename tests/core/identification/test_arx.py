"""ARX models against numpy's least squares on the tall matrix, known systems, and their own standard deviations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import freqz

from monitor_core.arrays import Floats
from monitor_core.identification import Record
from monitor_core.identification.black_boxes.arx import Arx, fit_arx
from tests.core.identification.systems import (
    INTERVAL_S,
    arx_record,
    bench_drive,
    bench_record,
    decibels,
)

law = settings(deadline=None, max_examples=12)
seeds = st.integers(0, 2**32 - 1)
FREQUENCIES = np.linspace(1.0, 60.0, 40)
A2, B2 = np.array([-1.5, 0.8]), np.array([0.6, -0.3])


def tall(records: Sequence[Record], n: int) -> tuple[Floats, Floats]:
    """Regressors and right-hand side, row by row, as the formula says; rows that need a NaN are left out."""
    Phi, right = [], []
    for k, record in enumerate(records):
        own = np.eye(len(records))[k].tolist()
        for t in range(n, len(record)):
            past = slice(t - 1, t - n - 1 if t > n else None, -1)
            row = [*-record.y[past], *record.u[past], *own]
            if np.isfinite([*row, record.y[t]]).all():
                Phi.append(row)
                right.append(record.y[t])
    return np.array(Phi), np.array(right)


def parameters(model: Arx) -> Floats:
    return np.concatenate([model.a, model.b, model.offset])


@law
@given(seeds, st.integers(1, 9), st.lists(st.integers(0, 399), max_size=6))
def test_equals_least_squares_of_the_rows_in_which_nothing_is_missing(seed: int, n: int, lost: list[int]) -> None:
    rng = np.random.default_rng(seed)
    records = [bench_record(rng, 400).without(np.array(lost, dtype=np.int64)), bench_record(rng, 150)]
    model = fit_arx(records, n)
    Phi, right = tall(records, n)
    theta, rss, *_ = np.linalg.lstsq(Phi, right)
    assert model.rows == len(Phi)
    assert parameters(model) == pytest.approx(theta, rel=1e-8, abs=1e-8 * abs(theta).max())
    assert model.lam0 == pytest.approx(rss[0] / (len(Phi) - Phi.shape[1]), rel=1e-8)
    scale = np.sqrt(np.diag(inverse := np.linalg.inv(Phi.T @ Phi)[:-2, :-2]))
    found = model.root @ model.root.T
    assert found / np.outer(scale, scale) == pytest.approx(inverse / np.outer(scale, scale), rel=1e-6, abs=1e-7)


def test_a_lost_sample_is_a_place_where_nothing_is_known(seed: int) -> None:
    record = arx_record(np.random.default_rng(seed), A2, B2, 2000, 0.0)
    keep = np.ones(2000, np.bool_)
    keep[100::40] = False
    model = fit_arx([record.select(keep)], 2)
    assert parameters(model) == pytest.approx([*A2, *B2, 0.0], abs=1e-9)
    assert model.rows == 2000 - 2 - 3 * 48


@law
@given(seeds, st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_units_scale_the_gain_only(seed: int, of_u: float, of_y: float) -> None:
    record = bench_record(np.random.default_rng(seed), 500)
    scaled = Record(record.t, record.u * of_u, record.y * of_y, "speed")
    original, converted = (fit_arx([r], 6).response(FREQUENCIES) for r in (record, scaled))
    assert pytest.approx(original.G * of_y / of_u, rel=1e-6) == converted.G
    assert converted.sd_db == pytest.approx(original.sd_db, rel=1e-5)


@pytest.mark.parametrize("noise_db", [-90.0, -120.0, -150.0])
def test_ill_conditioned_rows_keep_their_digits(seed: int, noise_db: float) -> None:
    """Hardly any noise: by the Gram matrix the parameters would be wrong by 1e-7, 1e-4 and 5 %."""
    record = bench_record(np.random.default_rng(seed), 3000, noise_db)
    Phi, right = tall([record], 7)
    theta = np.linalg.lstsq(Phi, right)[0]
    assert parameters(fit_arx([record], 7)) == pytest.approx(theta, abs=1e-8 * float(abs(theta).max()))


def test_without_noise_the_rank_is_said(seed: int) -> None:
    record = arx_record(np.random.default_rng(seed), A2, B2, 1000, 0.0)
    model = fit_arx([record], 6)
    assert model.root.shape[1] == 2 + 6 + 1
    truth = freqz([0, *B2], [1, *A2], 2 * np.pi * FREQUENCIES * INTERVAL_S)[1]
    assert pytest.approx(truth, rel=1e-6) == model.response(FREQUENCIES).G


def test_the_order_is_that_of_least_aic(seed: int) -> None:
    """All orders on the rows of the highest: the residuals of each from the tall matrix."""
    record = bench_record(np.random.default_rng(seed), 900)
    Phi, right = tall([record], 12)
    N, cost = len(Phi), []
    for n in range(1, 13):
        part = np.hstack([Phi[:, :n], Phi[:, 12 : 12 + n], Phi[:, -1:]])
        rss = np.linalg.lstsq(part, right)[1][0]
        cost.append(N * np.log(rss / N) + 2.0 * part.shape[1])
    chosen = fit_arx([record], largest=12)
    assert chosen.a.size == np.argmin(cost) + 1
    assert parameters(chosen) == pytest.approx(parameters(fit_arx([record], chosen.a.size)), rel=1e-9)


def test_standard_deviations_cover(seed: int) -> None:
    """120 records: the estimates scatter as the response says; 1.28 sd hold 80 %."""
    rng = np.random.default_rng(seed)
    truth = freqz([0, *B2], [1, *A2], 2 * np.pi * FREQUENCIES * INTERVAL_S)[1]
    responses = [fit_arx([arx_record(rng, A2, B2, 400, 0.5)], 3).response(FREQUENCIES) for _ in range(120)]
    w = np.array([np.log(r.G / truth) for r in responses])
    sd_gain = np.array([r.sd_db for r in responses]) * np.log(10) / 20
    sd_phase = np.array([r.sd_phase for r in responses])
    # Neighbouring frequencies move together: as if there were about six of them, 720 trials, sd 1.5 %.
    assert np.mean(abs(w.real) < 1.2816 * sd_gain) == pytest.approx(0.80, abs=0.06)
    assert np.mean(abs(w.imag) < 1.2816 * sd_phase) == pytest.approx(0.80, abs=0.06)


def test_the_bench_drive_is_found(seed: int) -> None:
    """The figures of a day: 0.14 dB at order 20 and a record of 8000 samples."""
    f = np.linspace(0.5, 40, 200)
    response = fit_arx([bench_record(np.random.default_rng(seed))], 30).response(f)
    error = decibels(response.G, bench_drive().response(f))
    assert abs(error).max() < 1.0
    assert np.sqrt(np.mean((error / response.sd_db) ** 2)) < 2.0


def test_mistakes_are_told(seed: int) -> None:
    record = bench_record(np.random.default_rng(seed), 100)
    with pytest.raises(ValueError, match=r"35 rows .* for 61 parameters"):
        fit_arx([record.without(slice(40, 45))], 30)
    jittered = Record(record.t + 1e-3 * np.sin(np.arange(100)), record.u, record.y, "speed", "a.csv")
    with pytest.raises(ValueError, match=r"a\.csv: \d+ of 99 intervals are not"):
        fit_arx([jittered], 3)
    slower = Record(record.t * 2, record.u, record.y, "speed", "b.csv")
    with pytest.raises(ValueError, match="one interval, resample"):
        fit_arx([record, slower], 3)
    with pytest.raises(ValueError, match="show only 0 to 100 Hz"):
        fit_arx([record], 3).response([150.0])
