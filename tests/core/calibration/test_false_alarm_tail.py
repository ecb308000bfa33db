"""The run-length formula of a CUSUM on what forgetting leaves of white noise, and its fit to excursions."""

import math

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.false_alarm_tail import (
    LEAST_H,
    LEVEL_SD,
    MAX_EXCURSIONS,
    TAU_SD,
    fit_peaks,
    log_mean_time,
    log_single,
)
from monitor_core.kernel.compile import entry

LAM = 0.98
TAU = 50.0
CASES = ((0.5, 1.0), (0.5, 3.0), (0.5, 6.0), (1.0, 0.5), (1.0, 2.0), (1.0, 3.0), (1.5, 1.0), (2.0, 0.5))
"""k and h of tests that alarm often enough to be counted."""
STEPS = 6_000_000
LOWEST = 0.8 * TAU
"""Of the excursions whose heights are kept."""


@entry
def watched(
    seed: int, steps: int, lam: Floats, share: Floats, k: Floats, h: Floats, tops: Floats
) -> tuple[Floats, Floats, int]:
    """Of noise of which shares are forgotten at different rates: alarms of each test, after which it restarts.

    And of tests that do not restart: excursions from zero beyond h; heights of those of the first, and their number.
    """
    np.random.seed(seed)
    parts, g, level, top = np.zeros(lam.size), np.zeros(k.size), np.zeros(k.size), np.zeros(k.size)
    alarms, single, found = np.zeros(k.size), np.zeros(k.size), 0
    for _ in range(steps):
        d = 0.0
        for i in range(lam.size):
            parts[i] = lam[i] * parts[i] + math.sqrt(1.0 - lam[i] * lam[i]) * np.random.standard_normal()
            d += share[i] * parts[i]
        for i in range(k.size):
            g[i] = max(0.0, g[i] + d - k[i])
            if g[i] > h[i]:
                alarms[i] += 1.0
                g[i] = 0.0
            level[i] = max(0.0, level[i] + d - k[i])
            top[i] = max(top[i], level[i])
            if level[i] == 0.0:
                single[i] += 1.0 if top[i] > h[i] else 0.0
                if i == 0 and top[i] > LOWEST and found < tops.size:
                    tops[found] = top[i]
                    found += 1
                top[i] = 0.0
    return alarms, single, found


def alarms_and_excursions(seed: int, k: Floats, h: Floats) -> tuple[Floats, Floats]:
    """Of noise of one memory."""
    alarms, single, _ = watched(seed, STEPS, np.array([LAM]), np.ones(1), k, h * TAU, np.zeros(0))
    return alarms, single


def test_formula_against_simulation(seed: int) -> None:
    """Within a quarter, and five standard deviations of the count."""
    k, h = np.array(CASES).T
    count, _ = alarms_and_excursions(seed, k, h)
    ratio = STEPS / count / np.exp(log_mean_time(k, h, np.array(TAU)))
    for case, n, r in zip(CASES, count, ratio, strict=True):
        print(f"k = {case[0]}, h = {case[1]} sigma tau: {n:.0f} alarms, mean time over formula {r:.3f}")
    assert (count > 150).all()
    assert (abs(np.log(ratio)) < 0.22 + 5 / np.sqrt(count)).all()


def test_an_excursion_is_one_however_far_it_goes(seed: int) -> None:
    """There are fewer than alarms, the more so the lower the threshold: within a tenth, and by chance."""
    k, h = np.array([(0.3, 2.0), (0.3, 5.0), (0.5, 1.5), (0.5, 4.0), (0.7, 3.0), (1.0, 1.5), (1.0, 2.5)]).T
    alarm, single = alarms_and_excursions(seed, k, h)
    off = np.log(single / alarm) - log_single(k, h)
    print(f"of alarms {(single / alarm).round(2)} are excursions, off by {off.round(3)} in the logarithm")
    assert (np.abs(off) < 0.1 + 4 / np.sqrt(single)).all()


def test_it_grows_with_both() -> None:
    k, h = np.linspace(0.1, 2.5, 30), np.linspace(0.0, 30.0, 100)
    grid = log_mean_time(k[:, np.newaxis], h, np.array(TAU))
    assert np.isfinite(grid).all()
    assert (np.diff(grid, axis=1) > 0).all()
    assert (np.diff(grid[:, 10:], axis=0) > 0).all()


# --- The fit: to what follows the formula, and to deviations that are remembered otherwise ----------------------------


MEMORY = 50.0
K = 1.0
SAMPLES = 1e8
FITS = 60


def log_often(h: Floats, tau: float, level: float) -> Floats:
    """Excursions in so many samples, h over sigma times memory, if the formula holds with this memory and level."""
    x = h * MEMORY / tau
    single = log_single(np.array(K), x) - log_mean_time(np.array(K), x, np.array(tau))
    return np.asarray(level + math.log(SAMPLES) + single)


def happened(rng: np.random.Generator, tau: float, level: float) -> Floats:
    """Heights of excursions, falling: a Poisson process."""
    h = np.linspace(0.8, 30.0, 6000)
    often = np.exp(log_often(h, tau, level))
    count = rng.poisson(often[0])
    return np.sort(np.interp(rng.uniform(0, often[0], count), often[::-1], h[::-1]))[::-1]


@pytest.mark.parametrize("share", [1.0, 3e-4], ids=["many", "few"])
def test_memory_and_level_are_found_within_what_is_stated(share: float, seed: int) -> None:
    """Of a dozen excursions, too, which say less."""
    rng = np.random.default_rng(seed)
    off, stated, counts = [], [], []
    for _ in range(FITS):
        tau, level = MEMORY * math.exp(TAU_SD * rng.standard_normal()), LEVEL_SD * rng.standard_normal()
        heights = happened(rng, tau, level + math.log(share))
        way = fit_peaks(K, heights, MEMORY, share * SAMPLES)
        off.append(np.linalg.solve(way.root, way.best - [math.log(tau), level]))
        stated.append(math.hypot(*way.root[0]))
        counts.append(int((heights > LEAST_H).sum()))
    spread = np.sqrt(np.mean(np.square(off), axis=0))
    print(f"{np.median(counts):.0f} excursions; off by {spread} of what is stated, {np.median(stated):.3f}")
    assert spread == pytest.approx([1.0, 1.0], abs=5 / math.sqrt(2 * FITS))
    assert np.median(stated) < TAU_SD


def test_how_often_the_lowest_is_reached_is_known_as_their_number_tells_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights = happened(rng, MEMORY, 0.0)
    way = fit_peaks(K, heights, MEMORY, SAMPLES)
    drawn = way.best + rng.standard_normal((2000, 2)) @ way.root.T
    log_rate = [
        log_often(heights[MAX_EXCURSIONS - 1 : MAX_EXCURSIONS], math.exp(log_tau), level) for log_tau, level in drawn
    ]
    assert np.std(log_rate) == pytest.approx(1 / math.sqrt(MAX_EXCURSIONS), rel=0.3)


def test_of_records_in_which_nothing_can_have_happened_the_formula_holds() -> None:
    way = fit_peaks(K, np.zeros(0), MEMORY, 1e-6)
    assert way.best == pytest.approx([math.log(MEMORY), 0.0], abs=1e-3)
    assert way.root @ way.root.T == pytest.approx(np.diag([TAU_SD**2, LEVEL_SD**2]), rel=1e-3, abs=1e-5)


def test_where_nothing_happened_though_it_was_expected_it_happens_less() -> None:
    """The longer the record, the less; until it is the formula that does not hold, and says what it said before."""
    expected = float(np.exp(log_often(np.array([LEAST_H]), MEMORY, 0.0))[0])
    ways = [fit_peaks(K, np.zeros(0), MEMORY, SAMPLES * count / expected) for count in (1.0, 4.0)]
    for way in ways:
        assert (way.best < [math.log(MEMORY), 0.0]).all()
    assert (ways[1].best < ways[0].best).all()
    absurd = fit_peaks(K, np.zeros(0), MEMORY, SAMPLES * 3000.0 / expected)
    assert absurd.best == pytest.approx([math.log(MEMORY), 0.0])
    assert absurd.root == pytest.approx(np.diag([TAU_SD, LEVEL_SD]))


@pytest.mark.soak
def test_what_is_remembered_longer_is_extrapolated(seed: int) -> None:
    """Fitted to a part of a long record, alarms are as frequent as counted in all of it, farther out."""
    lam, share = np.array([0.98, 0.995]), np.sqrt([0.9, 0.1])
    h, steps = MEMORY * np.array([3.0, 4.0, 5.0]), 8_000_000
    tops = np.zeros(100_000)
    found = watched(seed % 2**31, steps, lam, share, np.array([K]), np.full(1, np.inf), tops)[2]
    alarms = watched((seed + 1) % 2**31, 8 * steps, lam, share, np.full(3, K), h, np.zeros(0))[0]
    heights = np.sort(tops[:found])[::-1] / MEMORY
    assert found > MAX_EXCURSIONS
    way = fit_peaks(K, heights, MEMORY, steps)
    tau, level = np.exp(way.best[0]), way.best[1]
    log_rate = level - log_mean_time(np.array(K), h / tau, np.array(tau))
    counted = np.log(alarms / (8 * steps))
    print(f"memory {tau:.0f}, level {level:.2f}; counted {alarms}; off by {log_rate - counted}")
    assert (alarms > 30).all()
    assert (np.abs(log_rate - counted) < 0.15 + 4 / np.sqrt(alarms)).all()
