"""The moment, size and kind of a change in white noise, whose truth is known."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.detection.onset import SURE, Change, Past, change_of, find_change, return_of, scatter

N, RUNS = 40, 300


def series(rng: np.random.Generator, at: float, size: float, drift: bool) -> tuple[Floats, Floats, Floats]:
    """Edges, means over uneven stretches, and their standard deviations."""
    edges = np.append(0.0, np.cumsum(rng.uniform(0.5, 1.5, N)))
    sd = rng.uniform(0.5, 2.0, N)
    after = np.maximum(edges - at, 0.0)
    mean = np.diff(after**2 / 2 / (edges[-1] - at) if drift else after) / np.diff(edges)
    return edges, size * mean + sd * rng.standard_normal(N), sd


def changes(seed: int, drift: bool, size: float) -> tuple[list[Change], Floats]:
    rng = np.random.default_rng(seed)
    at = rng.uniform(8, 25, RUNS)
    return [find_change(*series(rng, moment, size, drift), 0.5) for moment in at], at


@pytest.mark.parametrize("drift", [False, True])
def test_the_interval_covers_the_moment_as_often_as_stated(drift: bool, seed: int) -> None:
    """90 % of 300 give or take 4.4 standard deviations of 1.7 %; a drift that begins within a stretch hardly shows."""
    found, at = changes(seed, drift, size=8.0 if drift else 3.0)
    covered = np.mean([c.low <= moment <= c.high for c, moment in zip(found, at, strict=True)])
    width = np.median([c.high - c.low for c in found])
    print(f"drift {drift}: covered {covered:.3f}, median width {width:.2f}")
    assert 0.82 < covered < 0.975
    assert width < (14 if drift else 5)
    assert all(c.low <= c.best <= c.high for c in found)


@pytest.mark.parametrize("drift", [False, True])
def test_step_and_drift_are_told_apart_and_sized(drift: bool, seed: int) -> None:
    found, _ = changes(seed, drift, size=8.0)
    odds = np.array([c.drift for c in found]) * (1 if drift else -1)
    z = np.array([(c.size - 8.0) / c.size_sd for c in found])
    print(f"drift {drift}: sure and right {np.mean(odds > SURE):.3f}, sure and wrong {np.mean(odds < -SURE):.4f}")
    assert np.mean(odds > SURE) > 0.9
    assert np.mean(odds < -SURE) < 0.03
    assert 0.8 < z.std() < 1.3


def test_a_change_before_the_past_has_no_earliest_moment(seed: int) -> None:
    """Nothing is known of the time before; a change in the first stretches may also have been before them."""
    rng = np.random.default_rng(seed)
    runs = [series(rng, -5.0, 3.0, drift=False) for _ in range(RUNS)]
    before = [find_change(*run, 0.5).low == run[0][0] for run in runs]
    print(f"said to be possible before the past: {np.mean(before):.3f}")
    assert np.mean(before) > 0.9
    runs = [series(rng, 8.0, 3.0, drift=False) for _ in range(RUNS)]
    assert np.mean([find_change(*run, 0.5).low > run[0][0] for run in runs]) > 0.9


def test_a_larger_scatter_than_stated_widens_the_interval(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges, values, sd = series(rng, 15.0, 3.0, drift=False)
    believed = find_change(edges, values, sd, 0.5)
    mistaken = find_change(edges, values, 0.2 * sd, 0.5)
    assert mistaken.size_sd > 0.6 * believed.size_sd


# --- The return of a parameter to its nominal value ---


SINCE, SECOND_US, LAM = 20, 1_000_000, 0.8
COVARIANCE = np.array(((1.0, 0.6), (0.6, 1.0)))


def changed_past(rng: np.random.Generator, size: float, back: float, others: float = 0.0) -> Past:
    """Of two parameters; the first one is off by ``size`` standard deviations of a stretch from 18 s to ``back``."""
    present = np.clip(np.arange(1, STRETCHES + 1) - 18, 0, 1) * np.clip(back - np.arange(STRETCHES), 0, 1)
    value = np.column_stack([size * present, np.full(STRETCHES, others)])
    value += rng.multivariate_normal(np.zeros(2), COVARIANCE, STRETCHES)
    d = np.zeros((STRETCHES, 2))
    for k in range(1, STRETCHES):  # with a constant P, theta is this mean of the stretches
        d[k] = LAM * d[k - 1] + (1 - LAM) * value[k - 1]
    t_us = SECOND_US * np.arange(STRETCHES, dtype=np.int64)
    return Past(t_us, d, np.tile((1 - LAM) * COVARIANCE, (STRETCHES, 1, 1)), LAM, 1.0, 0.0)


@pytest.mark.parametrize("alone", [True, False])
def test_a_return_is_found_and_what_is_left_is_before_it(alone: bool, seed: int) -> None:
    """A change that lasts seldom seems to end: the odds are those of the likeliest of forty moments."""
    rng = np.random.default_rng(seed)
    backs = rng.uniform(30, STRETCHES - 4, RUNS)
    others = 0.0 if alone else 3.0
    found = [return_of(changed_past(rng, 4.0, b, others), 0, alone, SINCE * SECOND_US) for b in backs]
    sure = np.array([odds > np.log(100) for _, odds in found])
    late = np.array([until_us / SECOND_US - b for (until_us, _), b in zip(found, backs, strict=True)])
    lasting = [return_of(changed_past(rng, 4.0, 1e9, others), 0, alone, SINCE * SECOND_US)[1] for _ in backs]
    print(f"found {sure.mean():.3f}, too late {np.mean(late[sure] > 0):.3f}, early by {-np.median(late[sure]):.2f} s")
    assert sure.mean() > 0.95
    assert np.mean(late[sure] > 0) < 0.1
    assert np.median(late[sure]) > -2.5
    assert np.mean(np.array(lasting) > np.log(100)) < 0.01


def test_estimates_that_scatter_more_than_stated_do_not_seem_to_return(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pasts = [changed_past(rng, 1.0, 1e9) for _ in range(RUNS)]
    understated = [past._replace(P=past.P / 9) for past in pasts]
    seems = np.mean([return_of(past, 0, True, SINCE * SECOND_US)[1] > np.log(100) for past in understated])
    print(f"seems to return: {seems:.3f}")
    assert seems < 0.1


def test_a_return_needs_some_stretches_of_the_change(seed: int) -> None:
    rng = np.random.default_rng(seed)
    short = changed_past(rng, 4.0, 1e9)
    assert return_of(short, 0, True, int(short.t_us[-1]))[1] == -np.inf
    assert return_of(short._replace(t_us=short.t_us[:5], d=short.d[:5], P=short.P[:5]), 0, True, 0)[1] == -np.inf


# --- A P that has become singular says nothing, and breaks nothing ---


STRETCHES, PARAMETERS = 60, 2


def past(seed: int) -> Past:
    """Of estimates that scatter as P says."""
    rng = np.random.default_rng(seed)
    t_us = 1_000_000 * np.arange(STRETCHES, dtype=np.int64)
    d = np.sqrt(0.5) * rng.standard_normal((STRETCHES, PARAMETERS))
    return Past(t_us, d, np.tile(np.eye(PARAMETERS), (STRETCHES, 1, 1)), 0.01, 1.0, 0.0)


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("at", [0, 30, STRETCHES - 2])
def test_a_singular_P_in_the_past(alone: bool, at: int, seed: int) -> None:
    sound = past(seed)
    singular = sound._replace(P=sound.P.copy())
    singular.P[at] = 1.0
    assert scatter(singular, 0) == pytest.approx(scatter(sound, 0), rel=0.5)
    assert (change_of(singular, 0, alone) is None) == (change_of(sound, 0, alone) is None)


def test_all_of_it_singular() -> None:
    nothing = past(1)._replace(P=np.ones((STRETCHES, PARAMETERS, PARAMETERS)))
    assert scatter(nothing, 0) == 1.0
    assert change_of(nothing, 0, alone=False) is None
