"""What friction is off by beside a measured temperature, on windows whose friction follows a law that is known."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification.thermal.measured_temperature import temperature_errors
from monitor_core.identification.thermal.warm_up_windows import WINDOW_S, Windows

CHANCE = 0.03
"""Standard deviation of a parameter in one window; 0.012 in a group of six."""
FALL = -0.01
"""Change of the first parameter per degree"""


def record(
    rng: np.random.Generator, minutes: int, hall: float = 20.0, lag_s: float = 0.0, off: float = 0.0
) -> tuple[Windows, Floats]:
    """A record from cold on, and what its thermometer shows.

    The gearbox warms up by 20 degrees, with a time constant of ten minutes.  ``off``: change of the first parameter
    that no temperature shows.
    """
    middle_s = np.asarray((np.arange(6 * minutes) + 0.5) * WINDOW_S, np.float64)
    gear = hall + 20.0 * (1 - np.exp(-middle_s / 600.0))
    shown = [hall]
    for now in gear.tolist():
        shown.append(shown[-1] + (now - shown[-1]) * (1 - np.exp(-WINDOW_S / lag_s) if lag_s else 1.0))
    delta = np.column_stack([FALL * (gear - 30.0) + off, np.zeros(gear.size)])
    information = np.repeat(np.eye(2)[np.newaxis] / CHANCE**2, gear.size, axis=0)
    score = (delta + rng.normal(0, CHANCE, delta.shape)) / CHANCE**2
    return Windows(middle_s, np.ones(gear.size), information, score), np.asarray(shown[1:], np.float64)


def errors(*records: tuple[Windows, Floats]) -> Floats:
    return temperature_errors([w for w, _ in records], [shown for _, shown in records], [0])


def test_the_temperature_of_the_gear_leaves_chance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = errors(record(rng, 40), record(rng, 40, hall=28.0))
    assert (found > 0).all()
    assert (found < 0.018).all()


def test_a_lag_is_found_at_the_beginning_of_one_record(seed: int) -> None:
    """It shows seven degrees too little for some minutes; a line over it cannot follow that."""
    rng = np.random.default_rng(seed)
    exact, late = (errors(record(rng, 40, lag_s=lag_s))[0] for lag_s in (0.0, 900.0))
    assert exact < 0.02 < late < 0.07


def test_each_day_is_judged_by_the_others(seed: int) -> None:
    """What is another value on another day is in the error, though a line through both would halve it."""
    rng = np.random.default_rng(seed)
    found = errors(record(rng, 40), record(rng, 40, off=0.1))
    assert found[0] == pytest.approx(0.1, rel=0.2)
    assert found[1] < 0.018


def test_the_warm_end_is_judged_by_what_was_before(seed: int) -> None:
    """A change in the last third, as of friction that goes on falling where the temperature does not rise."""
    rng = np.random.default_rng(seed)
    w, shown = record(rng, 60)
    step = np.where(np.arange(w.power.size) >= 240, -0.1, 0.0)
    changed = w._replace(score=w.score + np.einsum("wij,wj->wi", w.information, step[:, np.newaxis] * [1.0, 0.0]))
    assert errors((changed, shown))[0] > 0.08


def test_a_record_of_some_minutes_is_judged_as_one_and_a_shorter_one_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert 0 < errors(record(rng, 8))[0] < 0.03
    assert np.isnan(errors(record(rng, 4))).all()
