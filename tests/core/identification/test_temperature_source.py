"""Whether a measured temperature follows the motion, as that of a gear or a motor, or not, as that of a cabinet."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification.thermal.temperature_source import TemperatureCourse, follows_motion

WINDOW_S, STEP_S = 10.0, 1.0


def warmth(heating: Floats, *taus_s: float) -> Floats:
    """Of bodies one after the other, from cold on; a step a second."""
    for tau_s in taus_s:
        now, shown = 0.0, list[float]()
        for power in heating.tolist():
            now += (power - now) * STEP_S / tau_s
            shown.append(now)
        heating = np.array(shown)
    return heating


def course(temperature: Floats, friction: Floats, current: Floats, step: float = 1.0) -> TemperatureCourse:
    """In windows; ``step``: of the thermometer."""
    shown = np.rint(temperature / step) * step
    windows = [x.reshape(-1, round(WINDOW_S / STEP_S)).mean(axis=1) for x in (shown, friction, current)]
    return TemperatureCourse(windows[0], np.column_stack(windows[1:]))


def working(rng: np.random.Generator, minutes: float, pause: bool) -> tuple[Floats, Floats]:
    """Friction power and squared torque of programs of ten minutes, with a break of a quarter of an hour."""
    n = round(60 * minutes / STEP_S)
    programs = np.repeat(rng.uniform(0.7, 1.3, (2, n // 600 + 1)), 600, axis=1)[:, :n] if pause else np.ones((2, n))
    if pause:
        programs[:, n // 2 : n // 2 + 900] = 0.0
    friction, current = programs * [[30.0], [4.0]]
    return friction, current


def degrees(rng: np.random.Generator, kind: str, friction: Floats, current: Floats) -> Floats:
    hall, since = rng.uniform(15, 23), np.arange(friction.size) * STEP_S
    drift = rng.uniform(-1.0, 2.0) * since / 3600
    fast_s, slow_s, lag_s = rng.uniform(420, 900), rng.uniform(3300, 6000), rng.uniform(60, 600)
    if kind == "cabinet":
        return np.asarray(
            hall + 3 + rng.uniform(8, 15) * warmth(np.ones(friction.size), rng.uniform(600, 3000)) + drift
        )
    if kind == "motor":
        return np.asarray(hall + 4 * warmth(current, lag_s, slow_s) + warmth(current, lag_s) + drift)
    return np.asarray(hall + drift + 0.4 * warmth(friction, fast_s, lag_s) + 0.5 * warmth(friction, slow_s, lag_s))


@pytest.mark.parametrize(("kind", "expected"), [("gear", True), ("motor", True), ("cabinet", False)])
def test_a_break_tells(kind: str, expected: bool, seed: int) -> None:
    """Whole degrees do for the temperature of the axis."""
    rng = np.random.default_rng(seed)
    friction, current = working(rng, 80.0, pause=True)
    shown = course(degrees(rng, kind, friction, current), friction, current, 1.0 if expected else 0.1)
    assert follows_motion([shown], True) is expected


@pytest.mark.parametrize("kind", ["gear", "cabinet"])
def test_an_axis_that_always_works_alike_does_not_tell(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    friction, current = working(rng, 80.0, pause=False)
    assert follows_motion([course(degrees(rng, kind, friction, current), friction, current)], True) is None


def test_a_record_may_begin_warm(seed: int) -> None:
    """Its gear becomes colder at first; after a record from cold on, or alone."""
    rng = np.random.default_rng(seed)
    friction, current = working(rng, 80.0, pause=True)
    hot = np.exp(-np.arange(friction.size) * STEP_S / 3600.0) * 25.0
    warm = course(degrees(rng, "gear", friction, current) + hot, friction, current)
    cold = course(degrees(rng, "gear", friction, current), friction, current)
    assert follows_motion([warm], False)
    assert follows_motion([cold, warm], True)
