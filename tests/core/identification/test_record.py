"""Records: checked when made, selected, cut, and resampled."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.arrays import Floats
from monitor_core.identification import most_moving_parts
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.records.record_parts import between, pieces
from monitor_core.identification.records.uniform_grid import PASS, mean_torque, resample
from monitor_core.samples import SampleBlock
from tests.core.identification.record_cases import records, same


def record(t: object = (0, 1, 2), u: object = (1, 2, 3), y: object = (0, 0, 0), **other: object) -> Record:
    return Record(np.array(t), np.array(u), np.array(y), **({"quantity": "speed"} | other))  # type: ignore[arg-type]


def test_a_record_of_a_block_of_samples_keeps_microseconds() -> None:
    t_us = 1_760_000_000_000_001 + np.array([0, 1000, 2003])
    u, y, signals = np.arange(3.0), np.array([0.0, np.nan, 1.0]), np.arange(6.0).reshape(3, 2)
    found = Record.from_samples(
        SampleBlock(t_us, u, y, signals=signals, name="a.csv"), "angle", ("load", "warm"), start_s=2.0
    )
    assert found.t == pytest.approx([2.0, 2.001, 2.002003], abs=1e-9)
    assert (found.name, found.quantity, found.measured.tolist()) == ("a.csv", "angle", [True, False, True])
    assert {name: values.tolist() for name, values in found.signals.items()} == {
        "load": [0.0, 2.0, 4.0],
        "warm": [1.0, 3.0, 5.0],
    }
    with pytest.raises(ValueError, match="zip"):
        Record.from_samples(SampleBlock(t_us, u, y), "angle", ("load",))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t": (0, 1, 1)}, "times must increase, but after sample 1 at 1.0 s comes 1.0 s"),
        ({"t": (0, 2, 1)}, "times must increase, but after sample 1 at 2.0 s comes 1.0 s"),
        ({"t": (0, np.nan, 2)}, "the time of sample 1 is not finite"),
        ({"t": (0, np.inf, 2)}, "the time of sample 1 is not finite"),
        ({"u": (1, 2)}, "u has the shape (2,), not (3,) like the times"),
        ({"y": ((0, 0, 0),)}, "y has the shape (1, 3), not (3,) like the times"),
        ({"t": ((0, 1, 2),)}, "t has the shape (1, 3), not one dimension like the times"),
        ({"valid": np.array([True])}, "valid has the shape (1,), not (3,)"),
        ({"signals": {"temperature": np.zeros(4)}}, "temperature has the shape (4,), not (3,)"),
        ({"t": (0,), "u": (0,), "y": (0,)}, "1 samples; at least two are needed"),
        ({"u": (1, 2, -np.inf)}, "the torque of sample 2 is -inf; leave such samples out"),
        ({"quantity": "torque"}, "the quantity 'torque' is neither speed nor angle"),
    ],
)
def test_what_is_no_record(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(f"record a.csv: {message}")):
        record(name="a.csv", **arguments)


def test_the_output_is_nan_exactly_where_it_was_not_measured() -> None:
    r = record(y=(np.nan, 1, np.inf), valid=np.array([True, True, True]))
    assert r.measured.tolist() == [False, True, False]
    r = record(y=(5, 1, 7), valid=np.array([False, True, True]))
    assert np.isnan(r.y).tolist() == [True, False, False]
    assert record().measured.all()


def test_a_record_keeps_nothing_of_what_it_was_made_from() -> None:
    t, u, y, valid, s = np.arange(3.0), np.ones(3), np.full(3, np.nan), np.ones(3, np.bool_), np.ones(3)
    r = Record(t, u, y, "speed", valid=valid, signals={"s": s})
    assert valid.all()
    for array in (t, u, y, valid, s):
        array[:] = 0
    assert r.t.tolist() == [0, 1, 2]
    assert (r.u == 1).all()
    assert (r.signals["s"] == 1).all()


def test_times() -> None:
    r = record(t=np.array([0.0, 1.0, 2.1, 3.0, 4.0, 9.0]), u=np.ones(6), y=np.ones(6))
    assert r.intervals == pytest.approx([1, 1.1, 0.9, 1, 5])
    assert r.interval_s == pytest.approx(1.0)
    assert r.duration_s == 9.0
    assert r.jitter_s == pytest.approx(np.std([1, 1.1, 0.9, 1]))
    assert len(r) == 6
    assert (r.unit, record(quantity="angle").unit) == ("rad/s", "rad")


@given(records(), st.floats(0, 0.5), st.floats(0, 0.5))
def test_a_range_of_time(r: Record, start: float, length: float) -> None:
    inside = [k for k, t in enumerate(r.t) if start <= t - r.t[0] <= start + length]
    if len(inside) < 2:
        with pytest.raises(ValueError, match=f"record a has no two samples from .* s: it is {r.duration_s:g} s long"):
            between(r, start, start + length)
        return
    assert same(between(r, start, start + length), r.select(np.array(inside)))


@given(records())
def test_pieces_have_no_gap_and_hold_every_sample_that_has_a_neighbour(r: Record) -> None:
    gap = 10 * r.interval_s
    assert all(piece.intervals.max() <= gap for piece in pieces(r))
    near = np.concatenate(([False], r.intervals <= gap)) | np.concatenate((r.intervals <= gap, [False]))
    assert [t for piece in pieces(r) for t in piece.t] == r.t[near].tolist()


def test_samples_taken_out_are_not_measured() -> None:
    r = record().without(np.array([1]))
    assert r.measured.tolist() == [True, False, True]
    assert r.u.tolist() == [1, 2, 3]


# --- Resampling: the torque keeps its integral, the output its band and its phase, what is missing stays so -----------


class Tones:
    """A sum of sines of size 1, below that frequency [Hz]."""

    def __init__(self, rng: np.random.Generator, highest_hz: float) -> None:
        self.omega = 2 * np.pi * np.append(rng.uniform(0, highest_hz, 5), highest_hz)
        self.phase = rng.uniform(0, 6, 6)

    def __call__(self, t: Floats) -> Floats:
        total: Floats = np.sin(np.outer(t, self.omega) + self.phase).sum(axis=1)
        return total


def sampled(tones: Tones, jitter: float, rng: np.random.Generator, count: int = 8000, h: float = 0.001) -> Record:
    t = h * (np.arange(count, dtype=float) + jitter * rng.uniform(-1, 1, count))
    return Record(t, rng.normal(size=count), tones(t), "speed", signals={"s": 2 * tones(t)})


rngs = st.integers(0, 2**32).map(np.random.default_rng)
law = settings(deadline=None, max_examples=25)


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


@law
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


@law
@given(rngs, st.integers(2, 12), st.floats(1.0, 0.9 * 500 / 250))
def test_what_is_above_the_band_does_not_come_back(rng: np.random.Generator, factor: int, above: float) -> None:
    h = 0.001
    frequency = min(above * 0.5 / (factor * h), 0.49 / h)
    t = h * np.arange(6000, dtype=float)
    y = np.sin(2 * np.pi * frequency * t + rng.uniform(0, 6))
    new = resample(Record(t, t, y, "speed"), factor * h)
    assert abs(new.y[new.measured]).max() < 1.5e-3


@law
@given(rngs, st.integers(2, 8))
def test_missing_samples_stay_missing_and_spoil_no_others(rng: np.random.Generator, factor: int) -> None:
    tones = Tones(rng, 20.0)
    complete = sampled(tones, 0.0, rng)
    start = int(rng.integers(2000, 6000))
    hole = np.arange(start, start + 4 * factor)
    new, intact = (resample(r, factor * 0.001) for r in (complete.without(hole), complete))
    lost = intact.measured & ~new.measured
    near = (new.t > complete.t[hole[0] - 1] - factor * 0.001) & (new.t < complete.t[hole[-1] + 1] + factor * 0.001)
    inside = (new.t >= complete.t[hole[0]]) & (new.t <= complete.t[hole[-1]])
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
    with pytest.raises(ValueError, match=r"a record of 0.099 s has no two samples 0.1 s apart"):
        resample(r, 0.1)


# --- Long records are cut to the stretch with most motion, short ones stay ---


def lively_record(count: int, lively_from: int, length: int, name: str) -> Record:
    """An angle that hardly moves, but for a stretch."""
    t = np.asarray(0.005 * np.arange(count), np.float64)
    speed = np.full(count, 0.01)
    speed[lively_from : lively_from + length] = 1.0
    return Record(t, np.zeros(count), np.cumsum(speed), "angle", name)


@pytest.mark.parametrize("start", [0, 300, 700])
def test_the_liveliest_stretch_of_a_long_record(start: int) -> None:
    own = lively_record(1000, start, 300, "long")
    (part,) = most_moving_parts([own], 300)
    assert len(part) == 300
    assert part.t[0] == pytest.approx(own.t[start], abs=0.006)


def test_short_records_stay() -> None:
    records = [lively_record(n, 0, 10, str(n)) for n in (1000, 100, 600)]
    parts = most_moving_parts(records, 900)
    assert [len(part) for part in parts] == [400, 100, 400]
    assert parts[1] is records[1]
    assert [part is own for part, own in zip(most_moving_parts(records, 1700), records, strict=True)] == [True] * 3


def test_records_share_the_arrays_that_are_the_same() -> None:
    """Nothing can change them, neither through the record nor through what it was made from."""
    t = np.arange(6.0)
    first = Record(t, np.ones(6), np.zeros(6), "speed", signals={"load": np.zeros(6)})
    t[0] = -1.0
    assert first.t[0] == 0.0
    for values in (first.t, first.u, first.y, first.measured, first.signals["load"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 5.0
    other = replace(first, u=np.zeros(6), signals={**first.signals, "heat": np.ones(6)})
    assert other.t is first.t
    assert other.y is first.y
    assert other.signals["load"] is first.signals["load"]
    assert np.shares_memory(first.select(slice(2, 5)).t, first.t)
    every_second = first.select(slice(0, None, 2)).t
    assert every_second.flags.c_contiguous  # as sums depend on it, in the last bit
    assert every_second.tolist() == [0.0, 2.0, 4.0]


def test_what_is_not_measured_is_neither_valid_nor_a_number() -> None:
    found = Record(np.arange(4.0), np.ones(4), np.array([0.0, np.inf, 2.0, 3.0]), "speed", valid=np.arange(4) < 3)
    assert found.measured.tolist() == [True, False, True, False]
    np.testing.assert_array_equal(found.y, [0.0, np.nan, 2.0, np.nan])
