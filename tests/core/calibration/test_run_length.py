"""Mean time between false alarms of a CUSUM on what forgetting leaves of white noise: formula and simulation."""

import math

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.run_length import (
    log_mean_time,
    log_single,
    threshold,
)
from monitor_core.kernel.compile import entry

SIEGMUND = 1.166
"""By how much the threshold seems farther away, in textbooks."""


def white_noise_log_mean_time(k: float, h: float) -> float:
    """What textbooks give for white noise (Siegmund's formula), threshold h over sigma: the wrong one here.

    -log rate of one side at  E = (e^(2 k b) - 2 k b - 1) / (2 k^2),  b = h + 1.166.
    """
    x = 2 * k * (h + SIEGMUND)
    grown = math.log(math.expm1(x) - x) if x < 30 else x
    return grown - math.log(2 * k**2)


LAM = 0.98
TAU = 50.0
CASES = ((0.5, 1.0), (0.5, 3.0), (0.5, 6.0), (1.0, 0.5), (1.0, 2.0), (1.0, 3.0), (1.5, 1.0), (2.0, 0.5))
"""k and h of tests that alarm often enough to be counted."""
STEPS = 6_000_000


@entry
def alarms(seed: int, steps: int, lam: float, k: Floats, h: Floats) -> Floats:
    np.random.seed(seed)
    d, g, count = 0.0, np.zeros(k.size), np.zeros(k.size)
    for _ in range(steps):
        d = lam * d + math.sqrt(1.0 - lam * lam) * np.random.standard_normal()
        for i in range(k.size):
            g[i] = max(0.0, g[i] + d - k[i])
            if g[i] > h[i]:
                count[i] += 1.0
                g[i] = 0.0
    return count


def test_formula_against_simulation(seed: int) -> None:
    """Within a quarter, and five standard deviations of the count."""
    k, h = np.array(CASES).T
    count = alarms(seed, STEPS, LAM, k, h * TAU)
    ratio = STEPS / count / np.exp(log_mean_time(k, h, np.array(TAU)))
    for case, n, r in zip(CASES, count, ratio, strict=True):
        print(f"k = {case[0]}, h = {case[1]} sigma tau: {n:.0f} alarms, mean time over formula {r:.3f}")
    assert (count > 150).all()
    assert (abs(np.log(ratio)) < 0.22 + 5 / np.sqrt(count)).all()


@entry
def excursions(seed: int, steps: int, lam: float, k: Floats, h: Floats) -> Floats:
    """From zero, beyond h."""
    np.random.seed(seed)
    d, g, top, count = 0.0, np.zeros(k.size), np.zeros(k.size), np.zeros(k.size)
    for _ in range(steps):
        d = lam * d + math.sqrt(1.0 - lam * lam) * np.random.standard_normal()
        for i in range(k.size):
            g[i] = max(0.0, g[i] + d - k[i])
            top[i] = max(top[i], g[i])
            if g[i] == 0.0:
                count[i] += 1.0 if top[i] > h[i] else 0.0
                top[i] = 0.0
    return count


def test_an_excursion_is_one_however_far_it_goes(seed: int) -> None:
    """There are fewer than alarms, the more so the lower the threshold: within a tenth, and by chance."""
    k, h = np.array([(0.3, 2.0), (0.3, 5.0), (0.5, 1.5), (0.5, 4.0), (0.7, 3.0), (1.0, 1.5), (1.0, 2.5)]).T
    alarm, single = (of(seed, STEPS, LAM, k, h * TAU) for of in (alarms, excursions))
    off = np.log(single / alarm) - log_single(k, h)
    print(f"of alarms {(single / alarm).round(2)} are excursions, off by {off.round(3)} in the logarithm")
    assert (np.abs(off) < 0.1 + 4 / np.sqrt(single)).all()


def test_the_textbook_is_wrong_by_dozens_of_orders_of_magnitude() -> None:
    """k = sigma/4, h = sigma tau, tau = 200: 4e44 samples, where 1700 are true for the first alarm.

    Between two it is less: after an alarm the deviation is still large.
    """
    k, tau = 0.25, 200.0
    ours = float(log_mean_time(np.array(k), np.array(1.0), np.array(tau)))
    textbook = white_noise_log_mean_time(k, tau)
    print(f"white noise {textbook / math.log(10):.1f} decades, with its memory {ours / math.log(10):.1f}")
    assert 1661 / 2 < math.exp(ours) < 1661
    assert textbook / math.log(10) == pytest.approx(44.6, abs=1)


def test_textbook_formula_where_it_holds() -> None:
    """k = 0.5, h = 5, white noise: 938 for one side, by simulation."""
    assert math.exp(white_noise_log_mean_time(0.5, 5.0)) == pytest.approx(938, rel=0.02)


@pytest.mark.parametrize("k", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("log_samples", [9.0, 14.0, 40.0])
def test_threshold_is_the_inverse(k: float, log_samples: float) -> None:
    h = threshold(k, log_samples, TAU)
    assert h > 0
    assert float(log_mean_time(np.array(k), np.array(h), np.array(TAU))) == pytest.approx(log_samples)


def test_it_grows_with_both() -> None:
    k, h = np.linspace(0.1, 2.5, 30), np.linspace(0.0, 30.0, 100)
    grid = log_mean_time(k[:, np.newaxis], h, np.array(TAU))
    assert np.isfinite(grid).all()
    assert (np.diff(grid, axis=1) > 0).all()
    assert (np.diff(grid[:, 10:], axis=0) > 0).all()
