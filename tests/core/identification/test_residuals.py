"""Tests of prediction errors, their spectrum, and the covariance that reckons with it."""

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import kstest

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.greybox.residuals import (
    autoregression,
    independence,
    information,
    scores_covariance,
    whiteness,
)
from monitor_core.identification.records.motion_cells import PredictedMotion, motion_cells
from tests.shares import soaked

N = 3000
TIMES = np.asarray(0.01 * np.arange(6000), np.float64)


def test_white_errors_pass_at_the_stated_rate(seed: int) -> None:
    """p values are uniform; single correlations exceed their limit once in a hundred."""
    rng = np.random.default_rng(seed)
    found = [whiteness([rng.standard_normal(400), rng.standard_normal(300)]) for _ in range(300)]
    assert kstest([w.p_value for w in found], "uniform").pvalue > 1e-4
    beyond = np.mean([np.abs(w.values) > w.limit for w in found])
    assert beyond == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize("colour", [0.2, 0.9])
def test_coloured_errors_do_not(colour: float, seed: int) -> None:
    eps = lfilter([1], [1, -colour], np.random.default_rng(seed).standard_normal(N))
    found = whiteness([eps])
    assert found.p_value < 1e-3
    assert found.values[0] == pytest.approx(colour, abs=5 / np.sqrt(N))


@pytest.mark.parametrize(("colour", "band"), soaked(product([0.0, 0.8], [0.0, 0.95]), (0.8, 0.95)))
def test_independence_at_the_stated_rate(colour: float, band: float, seed: int) -> None:
    """Whatever the colour of errors and input."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(200):
        u, e = rng.standard_normal((2, 1000))
        found.append(independence([lfilter([1], [1, -band], u)], [lfilter([1], [1, -colour], e)]))
    assert np.mean([f.p_value < 0.01 for f in found]) < 0.05
    assert np.mean([f.p_value < 0.5 for f in found]) == pytest.approx(0.5, abs=0.2)
    beyond = np.mean([np.abs(f.values) > f.limit for f in found])
    # Of a slow input neighbouring lags go together: 200 records hold some 600 values.
    assert beyond == pytest.approx(0.01, abs=4 * np.sqrt(0.01 / 600))


def test_what_the_model_left_out_shows_at_its_lag(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(N)
    found = independence([u], [rng.standard_normal(N) + 0.2 * np.roll(u, 3)])
    assert found.p_value < 1e-6
    assert found.lags[np.argmax(found.values)] == 3
    feedback = independence([u], [rng.standard_normal(N) + 0.2 * np.roll(u, -3)])
    assert feedback.p_value > 1e-4
    assert feedback.lags[np.argmax(feedback.values)] == -3


def test_autoregression_finds_the_model(seed: int) -> None:
    e = np.random.default_rng(seed).standard_normal(20_000)
    a, variance = autoregression([lfilter([1], [1, -1.2, 0.5], e)])
    np.testing.assert_allclose(a[:3], [1, -1.2, 0.5], atol=0.05)
    assert variance == pytest.approx(1, abs=0.06)
    assert autoregression([e])[0].size <= 2


@pytest.mark.parametrize("count", [500, 80_000])
def test_covariance_of_the_scores_is_the_double_sum(count: int, seed: int) -> None:
    """Of a long record, too, in which only 500 samples depend on the parameters."""
    rng = np.random.default_rng(seed)
    psi, eps = np.zeros((count, 3)), lfilter([1], [1, -0.7], rng.standard_normal(count))
    excited = psi[count // 2 : count // 2 + 500] if count > 500 else psi
    excited[:] = rng.standard_normal((500, 3))
    S, order = scores_covariance([eps], [psi])
    a, variance = autoregression([eps])
    assert order == a.size - 1 > 0
    impulse = lfilter([1], a, np.eye(1, 5000)[0])
    R = variance * np.array([impulse[: 5000 - l] @ impulse[l:] for l in range(500)])
    np.testing.assert_allclose(S, excited.T @ toeplitz(R) @ excited, rtol=1e-6, atol=1e-6 * abs(S).max())


def test_the_information_is_that_of_all_records(seed: int) -> None:
    """Of a long one and a short one, of white errors; what the initial state explains is taken out of each."""
    rng = np.random.default_rng(seed)
    gradients = [rng.standard_normal((count, 3)) for count in (40_000, 300)]
    starts = [np.exp(-np.arange(len(psi)) / 50)[:, np.newaxis] for psi in gradients]
    eps = [rng.standard_normal(len(psi)) for psi in gradients]
    found = information("abc", np.array([1.0, 0.1, 30.0]), gradients, starts, eps, 2.0)
    own = [
        psi - start @ np.linalg.lstsq(start, psi, rcond=None)[0] for psi, start in zip(gradients, starts, strict=True)
    ]
    expected = 2.0 * np.linalg.inv(sum(psi.T @ psi for psi in own))
    np.testing.assert_allclose(found.white, expected, rtol=1e-9, atol=1e-9 * expected.max())


def test_errors_that_come_back_in_a_long_record_and_in_its_parts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    psi, cell = rng.standard_normal((40_000, 2)), rng.integers(0, 20, 40_000)
    psi[:, 0] += np.sin(cell)
    eps = rng.standard_normal(40_000) + 0.3 * (-1.0) ** cell

    def excess(*cuts: int) -> Floats:
        gradients, starts, errors = ([*np.split(values, cuts)] for values in (psi, np.zeros((40_000, 0)), eps))
        cells = [*np.split(cell, cuts)]
        return information("ab", np.ones(2), gradients, starts, errors, float(eps.var()), cells).excess

    assert excess()[0] > 2
    np.testing.assert_allclose(excess(9000, 11_000), excess(), rtol=1e-9)


def test_deviations_with_coloured_errors_are_those_that_occur(seed: int) -> None:
    """Linear regression, so that all of it is known: least squares on slow regressors with slow errors."""
    rng = np.random.default_rng(seed)
    psi = lfilter([1], [1, -0.95], rng.standard_normal((1000, 2)), axis=0)
    ends, reported, naive = [], [], []
    for _ in range(150):
        v = lfilter([1], [1, -0.9], rng.standard_normal(1100))[100:]
        theta = np.linalg.lstsq(psi, v, rcond=None)[0]
        eps = v - psi @ theta
        found = information(("a", "b"), np.ones(2), [psi], [np.zeros((1000, 0))], [eps], float(eps.var()))
        ends.append(theta)
        reported.append(np.sqrt(np.diag(found.covariance)))
        naive.append(np.sqrt(eps.var() * np.diag(np.linalg.inv(psi.T @ psi))))
    ratio = np.std(ends, axis=0) / np.mean(reported, axis=0)
    assert ratio == pytest.approx(1, abs=0.3)
    assert (np.std(ends, axis=0) / np.mean(naive, axis=0) > 2).all()


def a_motion(rng: np.random.Generator, samples: int = 6000) -> tuple[Floats, Floats]:
    """Angle and speed of an axis that goes on and on between six places; 100 Hz."""
    places, s = np.linspace(-1, 1, 6) + 0.1 * rng.standard_normal(6), np.linspace(0, 1, 80, endpoint=False)
    stops = rng.choice(places, samples // 80 + 2)
    angle = np.concatenate([a + (b - a) * (3 * s**2 - 2 * s**3) for a, b in pairwise(stops)])[:samples]
    return np.asarray(angle), np.gradient(angle, 0.01)


def deviations(psi: Floats, v: Floats, cells: Sequence[Ints]) -> tuple[Floats, Floats]:
    """Estimates by least squares, and their reported standard deviations."""
    theta = np.linalg.lstsq(psi, v, rcond=None)[0]
    eps = v - psi @ theta
    names = [f"p{k}" for k in range(psi.shape[1])]
    none = [np.zeros((len(v), 0))]
    found = information(names, np.ones(psi.shape[1]), [psi], none, [eps], float(eps.var()), cells)
    return np.asarray(theta, np.float64), np.asarray(found.excess * np.sqrt(np.diag(found.covariance)), np.float64)


def test_deviations_cover_errors_that_come_back_with_the_motion(seed: int) -> None:
    """Friction of an axis that also needs a torque which depends on its place, another one each way, unknown."""
    rng = np.random.default_rng(seed)
    pulls, without = list[Floats](), list[Floats]()
    for _ in range(40):
        angle, speed = a_motion(rng)
        cells = motion_cells([PredictedMotion(TIMES[: len(angle)], angle, "angle", abs(speed) > 0.05)])
        psi = np.stack([speed, np.sign(speed), np.ones(len(angle))], axis=1) * (abs(speed) > 0.05)[:, np.newaxis]
        lacks = sum(
            rng.standard_normal() * np.cos(k * angle + rng.uniform(0, 2 * np.pi) + way * np.sign(speed))
            for k in range(4, 9)
            for way in (0.0, 1.0)
        )
        v = 0.2 * (lacks + 0.2 * rng.standard_normal(len(angle))) * (abs(speed) > 0.05)
        for kept, given in ((pulls, cells), (without, [])):
            theta, sd = deviations(psi, v, given)
            kept.append(theta / sd)
    found, usual = (np.sqrt(np.mean(np.square(values), axis=0)) for values in (pulls, without))
    assert (found < 1.8).all()
    assert (usual > 1.5 * found).all()
    assert np.mean(usual) > 1.5


def test_the_deviation_is_that_of_the_sums_of_cells(seed: int) -> None:
    """Ten cells of twenty samples each, whose errors are alike in a cell: the mean of all is that of ten values."""
    rng = np.random.default_rng(seed)
    values, cell = rng.standard_normal(10), rng.permutation(np.repeat(np.arange(10), 20))
    theta, sd = deviations(np.ones((200, 1)), values[cell], [cell])
    assert theta == pytest.approx(values.mean())
    assert sd == pytest.approx(values.std(ddof=1) / np.sqrt(10), rel=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_so_few_cells_tell_nothing(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = rng.permutation(np.repeat(np.arange(count), 200 // count))
    v = 5.0 * cell + rng.standard_normal(200)
    (_, sd), (_, usual) = (deviations(np.ones((200, 1)), v, cells) for cells in ([cell], []))
    assert sd == pytest.approx(usual, rel=1e-12)


@pytest.mark.parametrize("colour", [0.0, 0.8])
def test_errors_that_do_not_depend_on_the_motion_keep_their_deviations(colour: float, seed: int) -> None:
    """One in a thousand is increased by chance; the limit is five of 450, with a probability of 1e-4 beyond it."""
    rng = np.random.default_rng(seed)
    increased = 0
    for _ in range(150):
        angle, speed = a_motion(rng, 1600)
        cells = motion_cells([PredictedMotion(TIMES[: len(angle)], angle, "angle", np.ones(len(angle), np.bool_))])
        psi = np.stack([speed, np.sign(speed), np.ones(len(angle))], axis=1)
        v = lfilter([1], [1, -colour], rng.standard_normal(len(angle)))
        (_, sd), (_, usual) = (deviations(psi, v, given) for given in (cells, ()))
        assert (sd >= usual * (1 - 1e-12)).all()
        increased += int(np.count_nonzero(sd > 1.001 * usual))
    assert increased <= 5


def test_initial_states_are_left_out_of_what_is_told(seed: int) -> None:
    """The covariance of some parameters of a regression with all of them."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((50, 5)) @ rng.standard_normal((5, 5))
    found = information(("a", "b"), np.ones(2), [J[:, :2]], [J[:, 2:]], [np.zeros(50)], 4.0)
    np.testing.assert_allclose(found.covariance, 4 * np.linalg.inv(J.T @ J)[:2, :2], rtol=1e-8)


def test_errors_that_are_zero_are_white() -> None:
    found = whiteness([np.zeros(400)])
    assert found.p_value == 1.0
    assert not found.values.any()
