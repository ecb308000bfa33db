"""Mean time between false alarms of a CUSUM on what forgetting leaves of white noise: formula and simulation."""

import math

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.false_alarm_tail import log_mean_time, log_single
from monitor_core.kernel.compile import entry

LAM = 0.98
TAU = 50.0
CASES = ((0.5, 1.0), (0.5, 3.0), (0.5, 6.0), (1.0, 0.5), (1.0, 2.0), (1.0, 3.0), (1.5, 1.0), (2.0, 0.5))
"""k and h of tests that alarm often enough to be counted."""
STEPS = 6_000_000


@entry
def alarms_and_excursions(seed: int, steps: int, lam: float, k: Floats, h: Floats) -> tuple[Floats, Floats]:
    """Alarms of each test, after which it restarts; and excursions from zero beyond h where it does not restart."""
    np.random.seed(seed)
    d, g, level, top = 0.0, np.zeros(k.size), np.zeros(k.size), np.zeros(k.size)
    alarms, single = np.zeros(k.size), np.zeros(k.size)
    for _ in range(steps):
        d = lam * d + math.sqrt(1.0 - lam * lam) * np.random.standard_normal()
        for i in range(k.size):
            g[i] = max(0.0, g[i] + d - k[i])
            if g[i] > h[i]:
                alarms[i] += 1.0
                g[i] = 0.0
            level[i] = max(0.0, level[i] + d - k[i])
            top[i] = max(top[i], level[i])
            if level[i] == 0.0:
                single[i] += 1.0 if top[i] > h[i] else 0.0
                top[i] = 0.0
    return alarms, single


def test_formula_against_simulation(seed: int) -> None:
    """Within a quarter, and five standard deviations of the count."""
    k, h = np.array(CASES).T
    count, _ = alarms_and_excursions(seed, STEPS, LAM, k, h * TAU)
    ratio = STEPS / count / np.exp(log_mean_time(k, h, np.array(TAU)))
    for case, n, r in zip(CASES, count, ratio, strict=True):
        print(f"k = {case[0]}, h = {case[1]} sigma tau: {n:.0f} alarms, mean time over formula {r:.3f}")
    assert (count > 150).all()
    assert (abs(np.log(ratio)) < 0.22 + 5 / np.sqrt(count)).all()


def test_an_excursion_is_one_however_far_it_goes(seed: int) -> None:
    """There are fewer than alarms, the more so the lower the threshold: within a tenth, and by chance."""
    k, h = np.array([(0.3, 2.0), (0.3, 5.0), (0.5, 1.5), (0.5, 4.0), (0.7, 3.0), (1.0, 1.5), (1.0, 2.5)]).T
    alarm, single = alarms_and_excursions(seed, STEPS, LAM, k, h * TAU)
    off = np.log(single / alarm) - log_single(k, h)
    print(f"of alarms {(single / alarm).round(2)} are excursions, off by {off.round(3)} in the logarithm")
    assert (np.abs(off) < 0.1 + 4 / np.sqrt(single)).all()


def test_it_grows_with_both() -> None:
    k, h = np.linspace(0.1, 2.5, 30), np.linspace(0.0, 30.0, 100)
    grid = log_mean_time(k[:, np.newaxis], h, np.array(TAU))
    assert np.isfinite(grid).all()
    assert (np.diff(grid, axis=1) > 0).all()
    assert (np.diff(grid[:, 10:], axis=0) > 0).all()
