"""Prediction-error fits of innovations models: derivatives, optimum, covariance, stability."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.excitation import multisine
from monitor_core.identification.blackbox import Data, System, fit_blackbox
from monitor_core.identification.innovations import Innovations
from monitor_core.identification.record import Record, split
from monitor_core.identification.subspace import fit_subspace
from monitor_core.identification.uniform_grid import on_grid
from tests.core.identification.systems import (
    INTERVAL_S,
    Discrete,
    bench_drive,
    bench_record,
    decibels,
    innovations_record,
    small_drive,
    times,
)

law = settings(deadline=None, max_examples=15)
seeds = st.integers(0, 2**32 - 1)
FREQUENCIES = np.linspace(0.5, 40.0, 60)


def some_system(rng: np.random.Generator, n: int) -> System:
    A = rng.normal(size=(n, n))
    A *= 0.9 / abs(np.linalg.eigvals(A)).max()
    return System(n, np.concatenate([A.ravel(), rng.normal(size=2 * n), 0.1 * rng.normal(size=n)]))


def some_data(rng: np.random.Generator, N: int = 60) -> Data:
    records = [Record(times(N), rng.normal(size=N), rng.normal(size=N), "speed") for _ in range(2)]
    return Data(on_grid([records[0], records[1].without(slice(10, 14))]))


def small_record(rng: np.random.Generator, N: int, sd: float = 0.3) -> Record:
    drive, K = small_drive()
    return innovations_record(rng, drive, K, rng.normal(size=N), sd)


def sum_of_squares(model: Innovations, record: Record) -> float:
    yhat = model.predict(record.u, record.y, model.starts[0])
    return float(np.nansum((record.y - yhat) ** 2))


@law
@given(seeds, st.integers(1, 5))
def test_gradient_is_that_of_the_cost(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    system, data, nuisance = some_system(rng, n), some_data(rng), rng.normal(size=(2, n + 1))
    P, step = np.linalg.qr(rng.normal(size=(n * n + 3 * n, 3)))[0], 1e-6
    _, g, cost = data.normal(system, nuisance, P)
    assert cost == pytest.approx(data.cost(system, nuisance), rel=1e-12)
    for k in range(g.size):
        delta = step * np.eye(g.size)[k]
        costs = [
            data.cost(system.moved(s * P @ delta[:3]), nuisance + s * delta[3:].reshape(2, -1))
            for s in (1, -1)
        ]
        assert -2 * g[k] == pytest.approx((costs[0] - costs[1]) / (2 * step), rel=1e-4, abs=1e-6 * cost)


@law
@given(seeds, st.integers(1, 5))
def test_directions_leave_out_changes_of_coordinates(seed: int, n: int) -> None:
    """Along them the cost changes; a change of coordinates is orthogonal to all of them."""
    rng = np.random.default_rng(seed)
    system = some_system(rng, n)
    P = system.directions()
    A, B, C, K = system.parts
    E = rng.normal(size=(n, n))
    change = np.concatenate([(A @ E - E @ A).ravel(), -E @ B, C @ E, -E @ K])
    assert P.shape == (n * n + 3 * n, 3 * n)
    assert pytest.approx(np.eye(3 * n), abs=1e-12) == P.T @ P
    assert P.T @ change == pytest.approx(np.zeros(3 * n), abs=1e-10 * float(np.linalg.norm(change)))


def test_the_optimum_is_one(seed: int) -> None:
    """No random neighbour is better, and the subspace start is worse."""
    rng = np.random.default_rng(seed)
    record = small_record(rng, 1000)
    model = fit_blackbox([record], 2)
    best = sum_of_squares(model, record)
    assert best == pytest.approx(model.lam0 * (1000 - 6 - 3), rel=1e-9)
    start = replace(fit_subspace([record], 2), starts=model.starts)
    assert best <= sum_of_squares(start, record)
    for _ in range(20):
        A = model.A + 1e-3 * rng.normal(size=(2, 2))
        B, C, K = (v + 1e-3 * rng.normal(size=2) for v in (model.B, model.C, model.K))
        assert sum_of_squares(replace(model, A=A, B=B, C=C, K=K), record) > best


def test_standard_deviations_cover(seed: int) -> None:
    """100 records of 500 samples: 1.28 reported sd hold 80 % of the errors, and lam0 is right on average."""
    rng, (drive, _) = np.random.default_rng(seed), small_drive()
    truth = drive.response(FREQUENCIES)
    models = [fit_blackbox([small_record(rng, 500)], 2) for _ in range(100)]
    responses = [model.response(FREQUENCIES) for model in models]
    w = np.array([np.log(r.G / truth) for r in responses])
    gain = abs(w.real) < 1.2816 * np.array([r.sd_db for r in responses]) * np.log(10) / 20
    phase = abs(w.imag) < 1.2816 * np.array([r.sd_phase for r in responses])
    # G has four parameters: about 400 independent trials, sd 2 %.
    assert gain.mean() == pytest.approx(0.80, abs=0.07)
    assert phase.mean() == pytest.approx(0.80, abs=0.07)
    assert np.mean([m.lam0 for m in models]) == pytest.approx(0.09, rel=4 * np.sqrt(2 / 500 / 100))


def test_deviations_do_not_depend_on_units_or_coordinates(seed: int) -> None:
    record = small_record(np.random.default_rng(seed), 800)
    scaled = Record(record.t, 50 * record.u + 3, 1e-3 * record.y + 1, "speed")
    one, two = (fit_blackbox([r], 2).response(FREQUENCIES) for r in (record, scaled))
    assert pytest.approx(one.G, rel=1e-3) == two.G * 5e4
    assert two.sd_db == pytest.approx(one.sd_db, rel=1e-2)
    assert two.sd_phase == pytest.approx(one.sd_phase, rel=1e-2)


def test_four_times_the_samples_halve_the_deviations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    records = [small_record(rng, 2000) for _ in range(4)]
    one = fit_blackbox(records[:1], 2).response(FREQUENCIES)
    four = fit_blackbox(records, 2).response(FREQUENCIES)
    assert np.median(one.sd_db / four.sd_db) == pytest.approx(2.0, rel=0.15)
    assert four.n_effective[0] == 8000


def test_closed_loop_is_no_obstacle(seed: int) -> None:
    rng, (drive, K) = np.random.default_rng(seed), small_drive()
    record = innovations_record(rng, drive, K, rng.normal(size=4000), 0.5, 0.15)
    response = fit_blackbox([record], 2).response(FREQUENCIES)
    z = decibels(response.G, drive.response(FREQUENCIES)) / response.sd_db
    assert abs(z).max() < 5


def test_missing_output_costs_only_its_information(seed: int) -> None:
    """A third of the output is missing here and there; rows of a regression would be gone altogether."""
    rng = np.random.default_rng(seed)
    record = bench_record(rng)
    lost = np.flatnonzero(rng.random(8000) < 0.33)
    lost = lost[lost > 3000]
    f = FREQUENCIES
    response = fit_blackbox([record.without(lost)], 5).response(f)
    z = decibels(response.G, bench_drive().response(f)) / response.sd_db
    assert response.n_effective[0] == 8000 - lost.size
    assert np.sqrt(np.mean(z**2)) < 3
    whole = fit_blackbox([record], 5).response(f)
    assert np.median(response.sd_db / whole.sd_db) < 1.5


def test_an_integrator_stays_inside_the_circle(seed: int) -> None:
    """Its pole wants to leave in half of the records; the others must not suffer from holding it."""
    rng, (drive, _) = np.random.default_rng(seed), small_drive()
    A = np.block([[drive.A, np.zeros((2, 1))], [0.05 * drive.C, np.ones((1, 1))]])
    angle = Discrete(A, np.vstack([drive.B, [[0.0]]]), np.array([[0.0, 0.0, 1.0]]))
    truth = angle.response(FREQUENCIES)
    for _ in range(6):
        record = innovations_record(rng, angle, np.zeros(3), rng.normal(size=2000), 0.005)
        model = fit_blackbox([record], 3)
        response = model.response(FREQUENCIES)
        assert model.stable
        assert abs(model.poles[0]) > 0.995
        assert np.sqrt(np.mean((decibels(response.G, truth) / response.sd_db) ** 2)) < 3


def test_offsets_of_each_record_are_its_own(seed: int) -> None:
    record = small_record(np.random.default_rng(seed), 3000)
    parts = split(record, (1, 1))
    moved = [Record(p.t, p.u + k, p.y - 5 * k, "speed") for k, p in enumerate(parts)]
    one, two = (fit_blackbox(rs, 2).response(FREQUENCIES) for rs in (parts, moved))
    assert pytest.approx(one.G, rel=1e-4) == two.G


def test_prediction_and_simulation_go_on_where_nothing_was_measured(seed: int) -> None:
    record = small_record(np.random.default_rng(seed), 1500, 0.02)
    model = fit_blackbox([record], 2)
    y = record.y.copy()
    y[100:200] = np.nan
    predicted = model.predict(record.u, y, model.starts[0])
    assert np.std(predicted[100:200] - record.y[100:200]) < 0.1
    assert np.std(model.simulate(record.u, model.starts[0]) - record.y) < 0.1


def test_band_limited_torque(seed: int) -> None:
    rng, (drive, K) = np.random.default_rng(seed), small_drive()
    record = innovations_record(rng, drive, K, multisine(rng, 4000, INTERVAL_S, (0.0, 30.0), 1.0), 0.3)
    response = fit_blackbox([record], 2).response(np.linspace(1, 30, 30))
    assert abs(decibels(response.G, drive.response(response.frequency_hz)) / response.sd_db).max() < 5


def test_mistakes_are_told(seed: int) -> None:
    record = small_record(np.random.default_rng(seed), 60)
    with pytest.raises(ValueError, match="25 samples for 25 parameters of order 6: too few"):
        fit_blackbox([record.select(slice(0, 25))], 6, past=6)
    unfinished = fit_blackbox([bench_record(np.random.default_rng(seed), 900)], 5, iterations=1)
    assert unfinished.words[-1] == "Not converged after 1 iterations."
