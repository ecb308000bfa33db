"""A motion that is run again and again is found with its period, in one record or in several; another one is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification import Record
from monitor_core.identification.records.record_parts import between
from monitor_core.identification.torque_balance.repeated_motion import repeated_after

H, PERIOD_S = 0.004, 10.0


def sines(rng: np.random.Generator, seconds: float, period_s: float = PERIOD_S, harmonics: int = 5) -> Floats:
    """A sum of harmonics of the period, of equal speeds in the mean, as robots are excited for their identification."""
    t = H * np.arange(round(seconds / H))
    turns = 2 * np.pi * np.arange(1, harmonics + 1) / period_s
    a, b = rng.normal(size=(2, harmonics))
    return np.asarray(
        sum(
            x / w * np.sin(w * t) + y / w * np.cos(w * t)
            for x, y, w in zip(a.tolist(), b.tolist(), turns.tolist(), strict=True)
        )
    )


def moved(rng: np.random.Generator, angle: Floats, other: Floats) -> Record:
    """Noisy samples; of the other axis an acceleration, too, which is noisier."""
    other = other + 2e-5 * rng.normal(size=other.shape)
    smooth = np.convolve(np.pad(other, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    change = np.gradient(np.gradient(smooth, H), H)
    signals = {"other": other, "other-acceleration": change}
    y = angle + 2e-5 * rng.normal(size=angle.shape)
    return Record(np.asarray(H * np.arange(y.size), np.float64), rng.normal(size=y.size), y, "angle", signals=signals)


@pytest.mark.parametrize("seconds", [20.0, 45.0])
def test_a_repeated_motion_has_its_period(seconds: float, seed: int) -> None:
    for k in range(8):
        rng = np.random.default_rng([seed, k])
        record = moved(rng, sines(rng, seconds), sines(rng, seconds))
        assert repeated_after([record]) == pytest.approx(PERIOD_S, rel=0.01)
        speed = np.gradient(record.y, H) + 0.01 * rng.normal(size=len(record))
        assert repeated_after([replace(record, y=speed, quantity="speed")]) == pytest.approx(PERIOD_S, rel=0.01)


def test_the_same_motion_in_each_of_several_files(seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = moved(rng, sines(rng, 40.0, 40.0), sines(rng, 40.0, 40.0))
    assert repeated_after([record]) is None
    assert repeated_after([record, record, record]) == pytest.approx(40.0, rel=0.01)
    assert repeated_after([record, moved(rng, sines(rng, 40.0, 40.0), sines(rng, 40.0, 40.0))]) is None


def test_what_does_not_repeat(seed: int) -> None:
    """The own motion alone, less than two repetitions, motion at random, an axis that stands."""
    for k in range(8):
        rng = np.random.default_rng([seed, k])
        again, once = sines(rng, 40.0), sines(rng, 40.0, 40.0, 20)
        assert repeated_after([moved(rng, again, once)]) is None
        assert repeated_after([moved(rng, once, again)]) is None
        assert repeated_after([between(moved(rng, again, again), 0.0, 1.7 * PERIOD_S)]) is None
    still = moved(rng, np.zeros(5000), np.zeros(5000))
    assert repeated_after([replace(still, y=np.zeros(5000))]) is None
