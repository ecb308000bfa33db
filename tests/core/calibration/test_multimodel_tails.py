"""Tails of a bank's excursions: far beyond the highest as they truly are, and as uncertain as they scatter."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.multimodel_tails import (
    ADDED_EXCURSIONS,
    LEAST_HEIGHT,
    TOP,
    BankTails,
    ExcursionPeaks,
    bank_tails,
)
from tests.core.calibration.healthy_multimodel import excursions_of

PLACES, MANY = 500, 40
FAR = 8.0
"""Logarithm of the factor by which what is looked at is seldomer than the highest excursions."""


def weights(rng: np.random.Generator, places: int = PLACES, draws: int = 200) -> tuple[Floats, Floats]:
    """Of motion and innovations: as they are, and so many draws."""
    drawn = rng.exponential(size=(2, 1 + draws, places))
    drawn /= drawn.mean(axis=2, keepdims=True)
    drawn[:, 0] = 1.0
    return drawn[0], drawn[1]


def farther(rng: np.random.Generator, draws: int = 200) -> Floats:
    return np.append(0.0, rng.standard_normal(draws))


def watched(heights: Floats, places: int = PLACES, swapped: bool = False) -> ExcursionPeaks:
    """Excursions straight up to each of heights (N, H), and back; all over so many places, with any innovations.

    ``swapped``: with innovations from all over, at any place.
    """
    N, H = heights.shape
    g = np.stack([heights, np.zeros((N, H))], axis=1).reshape(2 * N, H)
    place = np.arange(2 * N) * places // (2 * N)
    any_place = np.random.default_rng(N).integers(0, places, 2 * N)
    return excursions_of(g, *((any_place, place) if swapped else (place, any_place)))


def pareto(rng: np.random.Generator, shape: float, number: int, hypotheses: int) -> Floats:
    """Generalised Pareto excesses of scale 2 above LEAST_HEIGHT."""
    log = rng.exponential(size=(number, hypotheses))
    return np.asarray(LEAST_HEIGHT + 2 * (np.expm1(shape * log) / shape if shape else log))


@pytest.mark.parametrize("shape", [0.0, 0.2])
def test_far_out_it_is_what_it_truly_is(shape: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    number, H = 20 * TOP, 4 * MANY
    tails = bank_tails(watched(pareto(rng, shape, number, H)), H, weights(rng), farther(rng))
    log = FAR + np.log(number / TOP)
    h = LEAST_HEIGHT + 2 * (np.expm1(shape * log) / shape if shape else log)
    drawn = tails.log_rates(np.full(H, h), np.ones((1, H)))
    error = drawn[0] + log + np.log(2)  # of every other sample
    stated = drawn[1:].std(axis=0)
    print(f"shape {tails.shape[0].mean():.3f}, off {error.mean():+.2f} +- {error.std():.2f} ({stated.mean():.2f})")
    assert abs(error.mean()) < 0.5  # what their mean shape is off by, all are
    assert np.mean(abs(error) < 1.645 * stated) > 0.6
    assert tails.shape[0].std() < 0.03  # they do not differ, and are said not to


def test_those_that_differ_are_left_so(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights = np.concatenate([pareto(rng, shape, 20 * TOP, MANY // 2) for shape in (0.0, 0.3)], axis=1)
    shape = bank_tails(watched(heights), MANY, weights(rng), farther(rng)).shape[0]
    assert shape[: MANY // 2].mean() < 0.08
    assert shape[MANY // 2 :].mean() > 0.2


def test_a_few_that_differ_from_many_are_left_so(seed: int) -> None:
    """Most of how far they are off the others is kept: the others' shapes are all alike, but for chance."""
    rng, H, few = np.random.default_rng(seed), 3 * MANY, 9
    heights = np.concatenate([pareto(rng, 0.0, 5 * TOP, H - few), pareto(rng, 0.3, 5 * TOP, few)], axis=1)
    shape = bank_tails(watched(heights), H, weights(rng), farther(rng)).shape[0]
    assert shape[-few:].mean() > 0.35 * 0.3 + 0.65 * shape[:-few].mean()


def test_excursions_by_themselves_scatter_as_is_said(seed: int) -> None:
    """Nothing goes with the motion, nothing with the innovations, which are drawn with weights both."""
    rng, H = np.random.default_rng(seed), 4 * MANY
    tails = bank_tails(watched(pareto(rng, 0.1, 4 * TOP, H)), H, weights(rng), np.zeros(201))
    log_mean = np.log(tails.mean)
    drawn = pareto(rng, 0.1, TOP, H) - LEAST_HEIGHT
    assert log_mean[1:].std(axis=0).mean() == pytest.approx(np.log(drawn.mean(axis=0)).std(), rel=0.3)
    assert tails.log_rate[1:].std(axis=0).mean() == pytest.approx(1 / np.sqrt(TOP), rel=0.15)
    own = tails.shape[1:] - tails.shape[1:].mean(axis=1, keepdims=True)
    assert own.std(axis=0).mean() < 0.04  # of any one alone, known from its excursions: 0.051


def test_how_the_shape_goes_on_is_not_known_better_than_by_a_fifth(seed: int) -> None:
    """It makes far rates less certain where there is a shape, and changes next to nothing for an exponential tail."""
    rng, h, even = np.random.default_rng(seed), np.full(MANY, 60.0), np.ones((1, MANY))
    spread = {}
    for shape in (0.0, 0.2):
        peaks, w = watched(pareto(rng, shape, 20 * TOP, MANY)), weights(rng)
        for name, draws in (("known", np.zeros(201)), ("unknown", farther(rng))):
            rates = bank_tails(peaks, MANY, w, draws).log_rates(h, even)[1:]
            spread[shape, name] = rates.mean(axis=1).std()  # of what is common to all
    assert spread[0.2, "unknown"] > 1.5 * spread[0.2, "known"]
    assert spread[0.0, "unknown"] < 1.5 * spread[0.0, "known"]


def test_the_shape_holds_for_as_far_again_as_it_was_seen() -> None:
    """Then the slope stays; there is no step in either."""
    unit = np.ones((1, 1))
    tails = BankTails(np.array([5.0]), -10.0 * unit, 2.0 * unit, 0.2 * unit, seen=6.0)
    h = np.arange(5.0, 300.0, 0.01)
    rate = np.array([tails.log_rates(np.array([at]), unit)[0, 0] for at in h])
    slope = -np.diff(rate) / 0.01
    assert rate[0] == -10.0
    assert slope[0] == pytest.approx(1 / (2.0 * 0.8), rel=0.01)
    assert (np.diff(slope) < 1e-9).all()
    end = h[np.searchsorted(-rate, 10 + 12)]
    assert slope[h[:-1] > end].std() < 1e-9
    assert slope[np.searchsorted(h, end - 5)] > slope[-1] * 1.02
    steeper = tails.log_rates(np.array([25.0]), 2 * unit)[0, 0]
    # all of g, also below base
    assert steeper == pytest.approx(tails.log_rates(np.array([50.0]), unit)[0, 0])
    assert tails.log_rates(np.array([5.0]), 0.8 * unit)[0, 0] == pytest.approx(-10 + 1 / 1.6)


@pytest.mark.parametrize("swapped", [False, True], ids=["motion", "innovations"])
def test_places_that_alarm_alone_are_as_few_as_they_are(swapped: bool, seed: int) -> None:
    """All high excursions at five of fifty places, or with the innovations of five: the chance is that of five."""
    rng, places, each = np.random.default_rng(seed), 50, TOP
    heights = np.minimum(3 * rng.random((places, each)), 2.9)
    heights[rng.permutation(places)[:5]] = 1.0 + pareto(rng, 0.17, 5, each)  # its shape is amid the bounds
    w, none, column = weights(rng, places), np.zeros(201), heights.reshape(-1, 1)
    few, many = (
        bank_tails(watched(values, places, swapped), 1, w, none) for values in (column, rng.permutation(column))
    )
    assert few.log_rate[1:].std() > 2 * many.log_rate[1:].std()
    assert few.log_rate[1:].std() == pytest.approx(1 / np.sqrt(5), rel=0.4)
    for drawn in (few.log_rate, np.log(few.mean), few.shape):
        assert drawn[1:].mean() == pytest.approx(drawn[0, 0], abs=0.01)  # most draws lack some of the five


def test_few_excursions_are_as_an_exact_model_has_them(seed: int) -> None:
    peaks = ExcursionPeaks(2)
    peaks.samples = 1000
    place = np.zeros(2, np.int64)
    peaks.take(np.array([[2.5, 0.0], [0.0, 0.0]]), 0, place, place, peaks.course())
    tails = bank_tails(peaks, 2, weights(np.random.default_rng(seed)), np.zeros(201))
    assert tails.base.tolist() == [LEAST_HEIGHT, LEAST_HEIGHT]
    np.testing.assert_allclose(tails.mean[0], [(0.5 + ADDED_EXCURSIONS) / (1 + ADDED_EXCURSIONS), 1.0])
    np.testing.assert_allclose(tails.log_rate[0], -np.log(1000))
    assert (tails.shape == 0).all()
    np.testing.assert_allclose(tails.log_rates(np.array([3.0, 3.0]), np.ones((1, 2)))[0, 1], -np.log(1000) - 1)
