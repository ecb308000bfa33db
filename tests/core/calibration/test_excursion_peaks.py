"""Excursions of a bank's g: found as by hand, in whatever pieces, and the highest are all there."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.multimodel_tails import LEAST_HEIGHT, TOP, ExcursionPeaks
from tests.core.calibration.healthy_multimodel import excursions_of

PLACES = 500


def watched(g: Floats, pieces: int = 1) -> ExcursionPeaks:
    """The excursions of a course g (N, H), cut into pieces, which goes over all places."""
    place = np.arange(len(g)) * PLACES // len(g)
    return excursions_of(g, place, PLACES - place, pieces)


def walk(rng: np.random.Generator, samples: int, drift: float) -> Floats:
    """g (N,) of a CUSUM whose ratios are those of an exact model: normal, of mean -drift^2 / 2, and drift as sd."""
    g, out = 0.0, np.empty(samples)
    for k, ratio in enumerate(drift * rng.standard_normal(samples) - drift * drift / 2):
        g = max(0.0, g + ratio)
        out[k] = g
    return out


def excursions(g: Floats) -> Floats:
    """Largest g (k,) between each two zeros of g (N,)."""
    away = np.concatenate([[False], g > 0, [False]])
    begins, ends = np.flatnonzero(~away[:-1] & away[1:]), np.flatnonzero(away[:-1] & ~away[1:])
    return np.array([g[a:b].max() for a, b in zip(begins, ends, strict=True)])


def test_excursions_are_those_found_by_hand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    g = np.stack([walk(rng, 4000, drift) for drift in (0.5, 1.0)], axis=1)
    for pieces in (1, 7, 1000):
        extremes = watched(g, pieces)
        for i in range(2):
            ended = g[: np.flatnonzero(g[:, i] == 0.0)[-1] + 1, i]  # what has ended
            by_hand = excursions(ended)
            by_hand = np.sort(by_hand[by_hand > LEAST_HEIGHT])[::-1]
            base, above, (place, origin) = extremes.highest(i)
            assert base == LEAST_HEIGHT
            np.testing.assert_allclose(base + above, by_hand)
            peak = np.array([np.flatnonzero(g[:, i] == height)[0] for height in base + above])
            np.testing.assert_array_equal(place, peak * PLACES // len(g))
            np.testing.assert_array_equal(origin, PLACES - place)
            start, reached = extremes.events(i, TOP)
            first = start.astype(int)
            assert all((g[s : p + 1, i] > 0).all() for s, p in zip(first, peak, strict=True))
            assert all(g[s - 1, i] == 0.0 for s in first if s)
            share = (reached - start)[start < peak] / (peak - start)[start < peak]
            np.testing.assert_allclose(share, by_hand[-1] / by_hand[start < peak])
        np.testing.assert_array_equal(extremes.largest, g.max(axis=0))


def test_only_the_highest_are_kept_and_they_are_all_there(seed: int) -> None:
    heights = np.random.default_rng(seed).exponential(3.0, 20_000)
    g = np.stack([heights, np.zeros(len(heights))], axis=1).reshape(-1, 1)  # straight up to each, and back
    base, above, _ = watched(g, pieces=40).highest(0)
    expected = np.sort(heights)[::-1]
    assert base == expected[TOP]
    np.testing.assert_allclose(base + above, expected[:TOP])
