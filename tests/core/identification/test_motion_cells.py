"""Tests of the cells of a motion: places of an axis, each by how it moves there."""

from itertools import pairwise

import numpy as np
import pytest

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.structure import Output
from monitor_core.identification.records.motion_cells import PredictedMotion, motion_cells

H = 0.01


def motion(y: Floats, quantity: Output = "angle", counted: Bools | None = None) -> PredictedMotion:
    used = np.ones(len(y), np.bool_) if counted is None else counted
    return PredictedMotion(np.asarray(H * np.arange(len(y)), np.float64), y, quantity, used)


def swinging(rng: np.random.Generator, samples: int = 4000) -> Floats:
    t = H * np.arange(samples)
    phases = rng.uniform(0, 2 * np.pi, 3)
    return np.asarray(sum(np.sin(f * t + p) for f, p in zip((0.7, 1.9, 4.1), phases, strict=True)))


def test_each_place_and_speed_has_as_many_samples(seed: int) -> None:
    angle = swinging(np.random.default_rng(seed))
    (cell,) = motion_cells([motion(angle)])
    counts = np.bincount(cell)
    assert counts.size == 20
    assert counts == pytest.approx(len(angle) / 20, abs=3)
    # Places in ascending order, in each of them speeds.
    ends = [(angle[cell // 4 == k].min(), angle[cell // 4 == k].max()) for k in range(5)]
    assert all(high < low for (_, high), (low, _) in pairwise(ends))
    speed = np.gradient(angle, H)
    for place in range(5):
        means = [speed[cell == 4 * place + k].mean() for k in range(4)]
        assert means == sorted(means)
        assert means[0] < 0 < means[-1]


def test_what_comes_back_is_in_the_same_cell_in_any_record(seed: int) -> None:
    angle = swinging(np.random.default_rng(seed))
    first, second = motion_cells([motion(angle), motion(angle)])
    np.testing.assert_array_equal(first, second)


def test_only_counted_samples_are_divided_equally(seed: int) -> None:
    """An axis that mostly stands at one place."""
    angle = np.concatenate([np.full(20_000, 0.3), swinging(np.random.default_rng(seed))])
    moving = np.arange(len(angle)) >= 20_000
    (cell,) = motion_cells([motion(angle, counted=moving)])
    assert np.bincount(cell[moving]) == pytest.approx(200, abs=3)


def test_samples_that_were_not_measured_are_between_their_neighbours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = swinging(rng)
    missing = angle.copy()
    missing[rng.choice(len(angle), 800, replace=False)] = np.nan
    (cell,), (own,) = (motion_cells([motion(values)]) for values in (angle, missing))
    assert np.mean(cell == own) > 0.97


def test_a_speed_has_the_places_of_its_angle(seed: int) -> None:
    angle = swinging(np.random.default_rng(seed))
    (by_angle,), (by_speed,) = (
        motion_cells([m]) for m in (motion(angle), motion(np.asarray(np.gradient(angle, H)), "speed"))
    )
    assert np.mean(by_angle // 4 == by_speed // 4) > 0.97
