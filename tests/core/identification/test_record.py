"""Records: checked when made, selected, and cut."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor_core.identification.records.record import Record, between, segments
from tests.core.identification.record_cases import H, records, same


def record(t: object = (0, 1, 2), u: object = (1, 2, 3), y: object = (0, 0, 0), **other: object) -> Record:
    return Record(np.array(t), np.array(u), np.array(y), **({"quantity": "speed"} | other))  # type: ignore[arg-type]


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
        with pytest.raises(
            ValueError, match=f"record a has no two samples from .* s: it is {r.duration_s:g} s long"
        ):
            between(r, start, start + length)
        return
    assert same(between(r, start, start + length), r.select(np.array(inside)))


@given(records(), st.sampled_from([2 * H, 10 * H]))
def test_segments_have_no_gap_and_hold_every_sample_that_has_a_neighbour(r: Record, gap: float) -> None:
    pieces = segments(r, gap)
    assert all(piece.intervals.max() <= gap for piece in pieces)
    near = np.concatenate(([False], r.intervals <= gap)) | np.concatenate((r.intervals <= gap, [False]))
    assert [t for piece in pieces for t in piece.t] == r.t[near].tolist()


def test_samples_taken_out_are_not_measured() -> None:
    r = record().without(np.array([1]))
    assert r.measured.tolist() == [True, False, True]
    assert r.u.tolist() == [1, 2, 3]
