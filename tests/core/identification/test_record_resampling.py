"""Resampling: the torque's integral is conserved, the output keeps its band and its phase, what is missing stays so."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.identification.records import Record
from monitor_core.identification.records.uniform_grid import PASS, mean_torque, resample
from tests.core.identification.record_cases import records


class Tones:
    """A sum of sines of size 1, below that frequency [Hz]."""

    def __init__(self, rng: np.random.Generator, highest_hz: float) -> None:
        self.omega = 2 * np.pi * np.append(rng.uniform(0, highest_hz, 5), highest_hz)
        self.phase = rng.uniform(0, 6, 6)

    def __call__(self, t: Floats) -> Floats:
        total: Floats = np.sin(np.outer(t, self.omega) + self.phase).sum(axis=1)
        return total


def sampled(
    tones: Tones, jitter: float, rng: np.random.Generator, count: int = 8000, h: float = 0.001
) -> Record:
    t = h * (np.arange(count, dtype=float) + jitter * rng.uniform(-1, 1, count))
    return Record(t, rng.normal(size=count), tones(t), "speed", signals={"s": 2 * tones(t)})


rngs = st.integers(0, 2**32).map(np.random.default_rng)


@given(records(), st.floats(1.0, 30.0))
def test_the_integral_of_the_torque_is_conserved(r: Record, factor: float) -> None:
    interval = factor * r.interval_s
    if r.duration_s < interval:
        return
    new = resample(r, interval)
    impulse = sum(u * h for u, h in zip(new.u[:-1], new.intervals, strict=True))
    held = [max(0.0, min(b, new.t[-1]) - a) for a, b in zip(r.t[:-1], r.t[1:], strict=True)]
    assert impulse == pytest.approx(float(r.u[:-1] @ np.array(held)), abs=1e-12)
    assert new.u[-1] == r.u[np.flatnonzero(r.t <= new.t[-1] + 1e-12)[-1]]


@given(records())
def test_the_mean_of_one_interval_is_the_torque_held_there(r: Record) -> None:
    assert mean_torque(r, r.t) == pytest.approx(r.u, abs=1e-9)


@given(rngs, st.floats(2.0, 12.0), st.sampled_from([0.0, 0.2]))
def test_what_is_in_the_band_stays_as_it_is(rng: np.random.Generator, factor: float, jitter: float) -> None:
    """Size and phase: each of the six sines may lose a thousandth."""
    interval = 0.001 * factor
    tones = Tones(rng, PASS / 2 / interval * 0.999 if factor > 4 else 100.0)
    new = resample(sampled(tones, jitter, rng), interval)
    fine = new.measured
    assert fine.mean() > 0.9
    assert abs(new.y - tones(new.t))[fine].max() < 6e-3 + 1e-3 * (jitter > 0)
    assert abs(new.signals["s"] - 2 * tones(new.t))[fine].max() < 12e-3 + 2e-3 * (jitter > 0)


@given(rngs, st.integers(2, 12), st.floats(1.0, 0.9 * 500 / 250))
def test_what_is_above_the_band_does_not_come_back(
    rng: np.random.Generator, factor: int, above: float
) -> None:
    h = 0.001
    frequency = min(above * 0.5 / (factor * h), 0.49 / h)
    t = h * np.arange(6000, dtype=float)
    y = np.sin(2 * np.pi * frequency * t + rng.uniform(0, 6))
    new = resample(Record(t, t, y, "speed"), factor * h)
    assert abs(new.y[new.measured]).max() < 1.5e-3


@given(rngs, st.integers(2, 8))
def test_missing_samples_stay_missing_and_spoil_no_others(rng: np.random.Generator, factor: int) -> None:
    tones = Tones(rng, 20.0)
    whole = sampled(tones, 0.0, rng)
    start = int(rng.integers(2000, 6000))
    hole = np.arange(start, start + 4 * factor)
    new, intact = (resample(r, factor * 0.001) for r in (whole.without(hole), whole))
    lost = intact.measured & ~new.measured
    near = (new.t > whole.t[hole[0] - 1] - factor * 0.001) & (new.t < whole.t[hole[-1] + 1] + factor * 0.001)
    inside = (new.t >= whole.t[hole[0]]) & (new.t <= whole.t[hole[-1]])
    assert lost[inside & intact.measured].all()
    assert not (lost & ~near).any()
    assert abs(new.y - tones(new.t))[new.measured].max() < 0.02


def test_the_grid() -> None:
    r = Record(10 + 0.001 * np.arange(1001, dtype=float), np.ones(1001), np.ones(1001), "speed", "a")
    new = resample(r, 0.01)
    assert new.t == pytest.approx(10 + 0.01 * np.arange(101, dtype=float))
    assert (new.name, new.quantity) == ("a", "speed")
    assert new.y[new.measured] == pytest.approx(1.0, abs=1e-9)
    assert np.flatnonzero(~new.measured).tolist() == [*range(new.measured.argmax()), *range(101 - 19, 101)]


def test_as_it_is() -> None:
    r = Record(
        0.001 * np.arange(100, dtype=float),
        np.arange(100, dtype=float),
        np.arange(100, dtype=float) ** 2,
        "speed",
    )
    again = resample(r, 0.001)
    assert again.measured.all()
    assert again.y == pytest.approx(r.y, abs=1e-9)
    assert again.u == pytest.approx(r.u)


def test_what_cannot_be_resampled() -> None:
    t = 0.001 * np.arange(100, dtype=float)
    r = Record(t, t, t, "speed")
    with pytest.raises(ValueError, match=r"0.5 ms is shorter than that of the record, 1 ms"):
        resample(r, 0.0005)
    with pytest.raises(ValueError, match=r"a record of 0.099 s has no two samples 0.1 s apart"):
        resample(r, 0.1)
