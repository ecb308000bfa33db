"""Angles that start again are made whole: by the truth, whatever the blocks, and refused where two would do."""

import numpy as np
import pytest

from service.ingest.samples.unwrap import MotionPoint, Turns

H_US = 5000
GAP_US = 50_000


def moved(rng: np.random.Generator, n: int, fastest: float, harshest: float) -> np.ndarray:
    """A course of angles from rest, with speeds and changes of speed up to these, per sample."""
    change = rng.uniform(-1, 1, n) * harshest
    change[:2] = 0.0
    return np.asarray(np.cumsum(np.clip(np.cumsum(change), -fastest, fastest)) + rng.uniform(-100, 100))


@pytest.mark.parametrize("period", [2 * np.pi, 65536.0, 0.1])
@pytest.mark.parametrize("lowest", [0.0, -0.5])
def test_the_course_comes_back(period: float, lowest: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = moved(rng, 5000, 1.7 * period, 0.2 * period)  # faster than a period in a sample
    raw = (angle / period - lowest) % 1 * period + lowest * period
    turns = Turns(period, GAP_US)
    unwrapped, sure = turns.take(np.arange(5000) * H_US, raw)
    assert sure.all()
    assert turns.refused == 0
    np.testing.assert_allclose(unwrapped - unwrapped[0], angle - angle[0], atol=1e-9 * np.ptp(angle))
    away = (unwrapped - raw) / period
    assert np.abs(away - np.rint(away)).max() < 1e-9  # whole periods, without a sum of errors


def test_blocks_do_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([H_US, 2 * H_US, 20 * H_US], 3000, p=[0.9, 0.09, 0.01]))
    raw = rng.uniform(0, 1, 3000) * np.where(rng.random(3000) < 0.5, 1.0, 0.1)
    single, many = Turns(1.0, GAP_US), Turns(1.0, GAP_US)
    unwrapped, sure = single.take(t, raw)
    cuts = np.sort(rng.choice(3000, 50))
    parts = [many.take(a, b) for a, b in zip(np.split(t, cuts), np.split(raw, cuts), strict=True)]
    np.testing.assert_array_equal(unwrapped, np.concatenate([p[0] for p in parts]))
    np.testing.assert_array_equal(sure, np.concatenate([p[1] for p in parts]))
    assert single.refused == many.refused == np.count_nonzero(~sure) > 0


def test_a_jump_by_half_a_period_is_refused_and_what_follows_is_right() -> None:
    turns = Turns(1.0, GAP_US)
    unwrapped, sure = turns.take(np.arange(6) * H_US, np.array([0.8, 0.9, 0.5, 0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(sure, [True, True, False, True, True, True])
    np.testing.assert_allclose(unwrapped[sure], [0.8, 0.9, 1.1, 1.2, 1.3])
    assert turns.refused == 1


@pytest.mark.parametrize(("step", "expected"), [(0.39, 0.39), (0.61, -0.39), (0.41, None), (0.59, None)])
def test_how_far_from_expected_is_sure(step: float, expected: float | None) -> None:
    found, sure = Turns(1.0, GAP_US).take(np.array([0, H_US]), np.array([0.0, step]))
    assert bool(sure[1]) == (expected is not None)
    if expected is not None:
        assert found[1] == pytest.approx(expected)


@pytest.mark.parametrize(("after_us", "angle"), [(GAP_US, 2.05), (GAP_US + 1, 0.05), (-GAP_US - 1, 0.05)])
def test_after_a_gap_it_starts_afresh(after_us: int, angle: float) -> None:
    """Exactly where the kernel starts its predictor anew: later than a gap, or back in time."""
    turns = Turns(1.0, GAP_US)
    turns.take(np.array([0, H_US, 2 * H_US]), np.array([0.7, 0.8, 0.9]))  # 0.02 a millisecond
    unwrapped, sure = turns.take((2 * H_US + after_us) + np.array([0, 1]), np.array([0.05, 0.95]))
    assert sure.all()
    assert unwrapped == pytest.approx([angle, angle - 0.1])  # and from there it goes on


def test_it_goes_on_from_where_it_was() -> None:
    """Not later than the last sample, as where two records overlap."""
    turns = Turns(1.0, GAP_US)
    turns.resume(MotionPoint(0, 17.9, 0.1 / H_US))
    unwrapped, _ = turns.take(np.array([H_US]), np.array([0.0]))
    assert unwrapped[0] == pytest.approx(18.0)
    turns = Turns(1.0, GAP_US)
    turns.take(np.array([0, H_US, 2 * H_US]), np.array([0.7, 0.8, 0.9]))
    turns.take(np.array([2 * H_US, H_US]), np.array([0.3, 0.8]))
    unwrapped, sure = turns.take(np.array([3 * H_US]), np.array([0.0]))
    assert sure.all()
    assert unwrapped[0] == pytest.approx(1.0)
