"""Torque and motion are paired by time; whatever happens, nothing is mixed up or lost uncounted."""

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.sampling import DROP_REASONS
from tests.core.sampling.single_frames import Assembler, Kind, Paired

T_US, TOLERANCE_US, GAP_US = 5000, 2000, 50_000
START_US = 1_760_000_000_000_000
Event = tuple[Kind, int, float]  # kind, time of receipt, number of the cycle


def assembler() -> Assembler:
    return Assembler(T_US * 1e-6, TOLERANCE_US * 1e-6, GAP_US * 1e-6)


def run(events: list[Event], a: Assembler | None = None) -> tuple[list[Paired], dict[str, int]]:
    a = a or assembler()
    samples = [s for kind, t_us, value in events if (s := a.add(kind, t_us, value)) is not None]
    a.flush()
    return samples, {reason: n for reason, n in a.dropped.items() if n}


@st.composite
def traffic(draw: st.DrawFn, lossless: bool = False) -> list[Event]:
    """Cycles whose values were all received within the tolerance; some lost, repeated, or out of order."""
    events: list[tuple[float, Event]] = []
    jitter = st.integers(0, TOLERANCE_US)
    copies = st.just(1) if lossless else st.sampled_from([0, 1, 1, 1, 1, 2])
    shuffle = 1.9 if lossless else draw(st.sampled_from([0.0, 1.9, 8.0]))
    for cycle in range(draw(st.integers(1, 40))):
        kinds: tuple[Kind, Kind] = ("torque", "motion")
        for kind in kinds:
            for _ in range(draw(copies)):
                t_us = START_US + cycle * T_US + draw(jitter)
                # Shuffled by less than a pair: the order within a cycle; by more: across cycles.
                place = (2 * cycle if lossless else len(events)) + draw(st.floats(0, shuffle))
                events.append((place, (kind, t_us, float(cycle))))
    return [event for _, event in sorted(events, key=lambda e: e[0])]


@settings(max_examples=40)
@given(traffic())
def test_nothing_is_mixed_up_and_nothing_is_lost_uncounted(events: list[Event]) -> None:
    samples, dropped = run(events)
    missing = dropped.pop("missing", 0)
    assert all(s.torque == s.motion for s in samples)  # of one cycle
    assert all(a.t_us < b.t_us for a, b in itertools.pairwise(samples))
    assert len(events) == 2 * len(samples) + sum(dropped.values())
    if samples:
        assert samples[-1].torque - samples[0].torque + 1 == len(samples) + missing


@settings(max_examples=40)
@given(traffic(lossless=True))
def test_a_complete_stream_becomes_all_samples(events: list[Event]) -> None:
    samples, dropped = run(events)
    assert dropped == {}
    assert [s.torque for s in samples] == [float(cycle) for cycle in range(len(events) // 2)]


def test_the_time_is_that_of_the_counter_or_of_the_motion() -> None:
    samples, _ = run([("torque", START_US, 1.5), ("motion", START_US + 300, 2.5)])
    assert samples == [Paired(START_US + 300, 1.5, 2.5)]
    a = assembler()
    assert a.add("torque", START_US, 1.0) is None
    assert a.add("motion", START_US + 300, 2.0, START_US - 70) == Paired(START_US - 70, 1.0, 2.0)
    assert a.add("torque", START_US + T_US, 1.0, START_US + 4930) is None
    assert a.add("motion", START_US + T_US, 2.0) == Paired(START_US + 4930, 1.0, 2.0)


def cycle(k: int) -> list[Event]:
    return [("torque", START_US + k * T_US, float(k)), ("motion", START_US + k * T_US + 400, float(k))]


@pytest.mark.parametrize(
    ("events", "cycles", "dropped"),
    [
        pytest.param(
            [*cycle(0), ("torque", START_US + T_US, math.nan), cycle(1)[1], *cycle(2)],
            [0, 2],
            {"not_finite": 1, "unpaired": 1, "missing": 1},
            id="nan",
        ),
        pytest.param([*cycle(0), cycle(0)[1], *cycle(1)], [0, 1], {"repeated": 1}, id="repeated after"),
        pytest.param([cycle(0)[0], *cycle(0), *cycle(1)], [0, 1], {"repeated": 1}, id="repeated before"),
        pytest.param([*cycle(0), *cycle(2), *cycle(1)], [0, 2], {"out_of_order": 2, "missing": 1}, id="out of order"),
        pytest.param(
            [*cycle(0), *cycle(2), cycle(1)[0], *cycle(3)],
            [0, 2, 3],
            {"out_of_order": 1, "missing": 1},
            id="out of order alone",
        ),
        pytest.param([*cycle(0), cycle(1)[0], *cycle(2)], [0, 2], {"unpaired": 1, "missing": 1}, id="partner lost"),
        pytest.param(
            [*cycle(0), cycle(1)[0], *cycle(2), cycle(1)[1], *cycle(3)],
            [0, 2, 3],
            {"unpaired": 1, "late": 1, "missing": 1},
            id="partner late",
        ),
        pytest.param(
            [*cycle(0), ("torque", START_US + T_US, 1.0), ("motion", START_US + T_US + 2001, 1.0)],
            [0],
            {"unpaired": 2},
            id="beyond the tolerance",
        ),
        pytest.param(
            [*cycle(0), ("torque", START_US + T_US, 1.0), ("motion", START_US + T_US + 2000, 1.0)],
            [0, 1],
            {},
            id="at the tolerance",
        ),
        pytest.param([*cycle(0), *cycle(101)], [0, 101], {"missing": 100}, id="a pause"),
        pytest.param([*cycle(0), cycle(1)[0]], [0], {"unpaired": 1}, id="the end"),
    ],
)
def test_reasons(events: list[Event], cycles: list[int], dropped: dict[str, int]) -> None:
    samples, counted = run(events)
    assert [s.torque for s in samples] == cycles
    assert counted == dropped


def test_one_quantity_alone_does_not_pile_up() -> None:
    a = assembler()
    for k in range(1000):
        assert a.add("torque", START_US + k * T_US, 1.0) is None
    assert a.dropped["unpaired"] >= 998


def test_a_clock_that_was_set_back_costs_no_later_sample() -> None:
    a = assembler()
    back = [(kind, t_us - 3_600_000_000, value) for kind, t_us, value in [*cycle(3), *cycle(4)]]
    samples, dropped = run([*cycle(0), *cycle(1), cycle(2)[0], *back], a)
    assert [s.torque for s in samples] == [0, 1, 3, 4]
    assert dropped == {"unpaired": 1}
    assert a.clock_set_back == 1


def test_pairs_from_one_frame() -> None:
    a = assembler()
    assert a.add_pair(START_US, 1.0, 2.0) == Paired(START_US, 1.0, 2.0)
    assert a.add_pair(START_US + 2499, 1.0, 2.0) is None
    assert a.add_pair(START_US - 2501, 1.0, 2.0) is None
    assert a.add_pair(START_US + 4990, 1.0, math.inf) is None
    assert a.add_pair(START_US + 10_000, 3.0, 4.0) == Paired(START_US + 10_000, 3.0, 4.0)
    assert a.dropped == {
        **dict.fromkeys(DROP_REASONS, 0),
        "repeated": 2,
        "out_of_order": 2,
        "not_finite": 2,
        "missing": 1,
    }


def test_pairs_received_in_a_bunch_keep_the_times_of_the_counter() -> None:
    a = assembler()
    times = [START_US + k * T_US for k in range(4)]
    samples = [a.add_pair(START_US + 17_000 + i, 1.0, 2.0, t_us) for i, t_us in enumerate(times)]
    assert [s.t_us for s in samples if s] == times


def test_a_counter_that_was_anchored_anew() -> None:
    a = assembler()
    assert a.add_pair(START_US, 1.0, 1.0, START_US)
    assert a.add_pair(START_US + T_US, 1.0, 1.0, START_US) is None  # not after the last
    assert a.dropped["out_of_order"] == 2
    assert a.add_pair(START_US + 2 * T_US, 1.0, 1.0, START_US - 600_000)  # far back: set back, go on
    assert a.clock_set_back == 1
