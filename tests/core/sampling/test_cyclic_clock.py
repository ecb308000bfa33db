"""Times of samples of a controller that sends in cycles: the cycles are fitted to the times of receipt."""

import itertools
import random
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.sampling.clock_line import FIRST_SLEW, SLEW
from tests.core.sampling.single_frames import CyclicClock
from tests.shares import soaked

START_US = 1_760_000_000_000_000


CYCLE_US = 5000


class Sent(NamedTuple):
    """A frame: the cycle it was sent in, when that was, when it was received."""

    cycle: int
    sent_us: float
    received_us: int


class Reading(NamedTuple):
    """The time that the clock gives the frame of that cycle, or why it gives none."""

    cycle: int
    time: int | str


def sending(
    cycles: Iterable[int],
    late_us: Callable[[], float],
    cycle_us: float = CYCLE_US,
    start_us: float = START_US,
) -> list[Sent]:
    """Frames of these cycles, in order as a bus keeps them, however late."""
    found, before_us = list[Sent](), 0
    for cycle in cycles:
        sent_us = start_us + cycle * cycle_us
        before_us = max(before_us + 20, round(sent_us + late_us()))
        found.append(Sent(cycle, sent_us, before_us))
    return found


def readings(clock: CyclicClock[int], frames: Iterable[Sent], *, last: bool = True) -> list[Reading]:
    found = [Reading(*reading) for frame in frames for reading in clock.read(frame.received_us, frame.cycle)]
    return found + [Reading(*reading) for reading in clock.flush()] if last else found


def times(found: Iterable[Reading]) -> dict[int, int]:
    return {reading.cycle: reading.time for reading in found if isinstance(reading.time, int)}


def rejected(found: Iterable[Reading]) -> list[Reading]:
    return [reading for reading in found if isinstance(reading.time, str)]


def wrong(found: Sequence[Reading], frames: Sequence[Sent], phase_us: float) -> list[int]:
    """The cycles of frames with a time that is further off than half a cycle."""
    sent = {frame.cycle: frame.sent_us for frame in frames}
    return [c for c, t in times(found).items() if abs(t - sent[c] - phase_us) > CYCLE_US / 2]


def on_time() -> float:
    return 0.0


def running() -> CyclicClock[int]:
    """A clock that has read the first 300 cycles, which all came on time."""
    clock = CyclicClock[int](0.005)
    readings(clock, sending(range(300), on_time), last=False)
    return clock


def after(cycles: int, then: Iterable[int]) -> list[int]:
    """So many cycles, then these after them."""
    return [*range(cycles), *(cycles + n for n in then)]


@settings(max_examples=15)
@given(
    lost=st.sets(st.integers(1, 299), max_size=30),
    seed=st.integers(0, 2**32),
)
def test_frames_late_by_less_than_a_cycle_have_whole_cycles_between_them(lost: set[int], seed: int) -> None:
    rng = random.Random(seed)
    frames = sending((n for n in range(300) if n not in lost), lambda: rng.randint(0, 2000))
    found = readings(CyclicClock(0.005), frames)
    assert [reading.cycle for reading in found] == [frame.cycle for frame in frames]
    # At the very beginning the phase is that of one frame, which may have been late itself.
    assert all(reading.time == "repeated" and reading.cycle < 30 for reading in rejected(found))
    given_us = [(c, t) for c, t in times(found).items() if c >= 30]
    for (a, before_us), (b, time_us) in itertools.pairwise(given_us):
        assert abs(time_us - before_us - (b - a) * CYCLE_US) <= FIRST_SLEW * (b - a) * CYCLE_US + 2


@pytest.mark.parametrize("ppm", [-100, 0, 100, -750, 750])
def test_phase_and_rate_are_found_whatever_the_jitter(ppm: float, seed: int) -> None:
    rng, cycle_us = random.Random(seed), CYCLE_US * (1 + ppm * 1e-6)
    frames = sending((n for n in range(12_000) if rng.random() > 0.01), lambda: rng.expovariate(1 / 400), cycle_us)
    clock = CyclicClock[int](0.005)
    found = readings(clock, frames)
    # A frame is late by three quarters of a cycle with e^-9.4; it then has the next one's time for lack of that.
    assert len(wrong(found, frames, 40)) < 20
    assert len(rejected(found)) < 20
    assert clock.reanchored == 0
    assert clock.interval_s == pytest.approx(cycle_us * 1e-6, rel=30e-6)  # 15 windows: 5 ppm
    late = [(c, t) for c, t in times(found).items() if c > 4000]
    off = [t2 - t1 - (b - a) * cycle_us for (a, t1), (b, t2) in itertools.pairwise(late)]
    assert sum(abs(d) > 2 + 2 * SLEW * CYCLE_US for d in off) < 40


def test_a_jitter_to_both_sides_by_a_fifth_of_a_cycle(seed: int) -> None:
    rng = random.Random(seed)
    frames = sending(range(8000), lambda: rng.gauss(0, 1000))
    found = readings(CyclicClock(0.005), frames)
    # Over sixty seeds at most 9 and 64.
    assert len(wrong(found, frames, -1300)) < 100
    assert len(rejected(found)) < 160


@pytest.mark.parametrize(
    ("every_us", "lost", "ppm"),
    soaked(
        list(itertools.product([8_000, 16_000, 32_000], [0.0, 0.002], [0, 80])),
        *[(8_000, 0.002, 80), (16_000, 0.0, 0), (16_000, 0.002, 0), (32_000, 0.002, 80)],
    ),
)
def test_an_adapter_that_passes_frames_on_in_bunches(every_us: int, lost: float, ppm: float, seed: int) -> None:
    """The last frame of a bunch is late by anything up to a cycle, so counting tells the cycles."""
    rng = random.Random(seed)
    passed_on = itertools.count(every_us, every_us)
    at_us, frames, cycle_us = next(passed_on), list[Sent](), CYCLE_US * (1 + ppm * 1e-6)
    for n in range(12_000):
        sent_us = START_US + n * cycle_us
        if rng.random() < lost:
            continue
        while START_US + at_us < sent_us:
            at_us = next(passed_on)
        before_us = frames[-1].received_us + 100 if frames else 0
        frames.append(Sent(n, sent_us, max(before_us, START_US + at_us + round(rng.expovariate(1 / 50)))))
    clock = CyclicClock[int](0.005)
    found = readings(clock, frames)
    assert len(rejected(found)) < 20
    assert clock.reanchored == 0
    assert clock.interval_s == pytest.approx(cycle_us * 1e-6, rel=40e-6)
    # Where a frame was lost its bunch may be counted to the cycle before.
    assert len(wrong(found, frames, 600)) < 20 + 4 * lost * len(frames)


def test_a_cycle_that_is_not_the_nominal_one_spoils_no_more_than_itself(seed: int) -> None:
    rng, clock = random.Random(seed), CyclicClock[int](0.005)
    frames = sending(range(6000), lambda: rng.expovariate(1 / 400), 5050)
    given_us = times(readings(clock, frames))
    assert all(abs(given_us[f.cycle] - f.sent_us) < 3 * CYCLE_US for f in frames if f.cycle in given_us)
    assert clock.interval_s is not None
    assert abs(clock.interval_s / 0.005 - 1) <= 2001e-6


def held_up(length: int, waited: int, spacing_us: int = 20) -> list[Sent]:
    """Frames of which the host received so many in one burst."""
    frames = sending(range(length), on_time)
    end_us = frames[300 + waited].received_us
    burst = [f._replace(received_us=end_us + spacing_us * k) for k, f in enumerate(frames[301 : 301 + waited])]
    # What would have come before the end of the burst waits, too, and is left out here.
    after_us = burst[-1].received_us
    return [*frames[:301], *burst, *(f for f in frames[301 + waited :] if f.received_us > after_us)]


@pytest.mark.parametrize(("waited", "spacing_us"), [(2, 20), (10, 400), (80, 20), (80, 50)])
def test_a_burst_after_the_host_was_held_up_is_taken_in_order(waited: int, spacing_us: int) -> None:
    frames = held_up(600, waited, spacing_us)
    found = readings(CyclicClock(0.005), frames)
    assert times(found) == {f.cycle: f.sent_us for f in frames}
    assert not rejected(found)


def test_of_a_burst_that_waited_longer_than_can_be_told_the_first_are_refused() -> None:
    frames = held_up(1500, 600, 1)
    clock = CyclicClock[int](0.005)
    found = readings(clock, frames)
    assert {reading.time for reading in rejected(found)} == {"untimed"}
    assert len(rejected(found)) == 500
    assert all(abs(t - START_US - c * CYCLE_US) <= 700 for c, t in times(found).items())
    assert clock.reanchored == 1


def test_lost_frames_leave_whole_cycles_and_one_frame_is_waited_for() -> None:
    clock = CyclicClock[int](0.005)
    assert len(readings(clock, sending(range(300), on_time), last=False)) == 300
    assert readings(clock, sending([303], on_time), last=False) == []
    found = readings(clock, sending([304, 305], on_time), last=False)
    assert found == [Reading(c, START_US + c * CYCLE_US) for c in (303, 304, 305)]
    found = readings(CyclicClock(0.005), sending(after(300, [4]), on_time))
    assert found[-1] == Reading(304, START_US + 304 * CYCLE_US)


def test_a_repeated_frame_and_one_from_before_are_refused() -> None:
    clock = running()
    last_us = START_US + 299 * CYCLE_US
    assert clock.read(last_us + 30, 7) == [(7, "repeated")]
    assert clock.read(last_us - 60 * CYCLE_US, 8) == [(8, "out_of_order")]
    assert clock.read(last_us + CYCLE_US, 9) == [(9, last_us + CYCLE_US)]


@pytest.mark.parametrize("back_s", [1.6, 100.0])
def test_a_clock_that_is_set_back_is_doubted_for_a_second(back_s: float) -> None:
    clock = running()
    frames = sending(range(300, 800), on_time, start_us=START_US - back_s * 1e6)
    found = readings(clock, frames)
    assert [reading.time for reading in found[:200]] == ["untimed"] * 200
    assert found[200:] == [Reading(f.cycle, f.received_us) for f in frames[200:]]
    assert clock.reanchored == 1


@pytest.mark.parametrize("back_us", [8_000, 60_000, 300_000, 480_000])
def test_where_the_clock_is_set_back_a_little_the_cycles_are_counted_on(back_us: int, seed: int) -> None:
    """Waiting for its former time would hide the motion of that long, which looks like a fault of the axis."""
    rng, clock = random.Random(seed), CyclicClock[int](0.005)
    late = lambda: rng.uniform(0, 300)  # noqa: E731
    before = readings(clock, sending(range(3000), late), last=False)
    found = readings(clock, sending(range(3000, 9000), late, start_us=START_US - back_us))
    assert [reading.time for reading in found if reading.cycle == 3000] == ["out_of_order"]
    assert [reading.cycle for reading in rejected(found)] == [3000]
    assert clock.reanchored == 1
    given_us = list(times([*before[-1000:], *found]).items())
    steps = [(t - before_us) / (c - at) for (at, before_us), (c, t) in itertools.pairwise(given_us)]
    assert steps == pytest.approx([CYCLE_US] * len(steps), abs=1 + 2 * SLEW * CYCLE_US)
    ahead_us = given_us[-1][1] - (START_US - back_us + 8999 * CYCLE_US)
    assert ahead_us == pytest.approx(max(0, back_us - SLEW * 6000 * CYCLE_US), abs=400)


def test_where_the_clock_is_set_back_while_frames_are_held_they_keep_their_times() -> None:
    clock = running()
    assert readings(clock, sending([302], on_time), last=False) == []
    found = readings(clock, sending(range(303, 400), on_time, start_us=START_US - 60_000))
    assert [reading.cycle for reading in rejected(found)] == [303]
    given_us = times(found)
    assert given_us[302] == START_US + 302 * CYCLE_US
    assert given_us[304] == pytest.approx(START_US + 304 * CYCLE_US, abs=2)


@pytest.mark.parametrize("back_s", [0.6, 1.4])
def test_untimed_frames_are_not_counted_so_after_them_the_line_restarts(back_s: float) -> None:
    clock = running()
    frames = sending(range(300, 800), on_time, start_us=START_US - back_s * 1e6)
    found = readings(clock, frames)
    doubted = round((back_s - 0.5) / 0.005)
    assert {reading.time for reading in found[: doubted - 1]} == {"untimed"}
    assert found[doubted + 2 :] == [Reading(f.cycle, f.received_us) for f in frames[doubted + 2 :]]
    assert clock.reanchored == 1


def test_no_jitter_looks_like_a_clock_that_is_set_back(seed: int) -> None:
    rng, clock = random.Random(seed), CyclicClock[int](0.005)
    late = lambda: rng.expovariate(1 / 10_000)  # noqa: E731
    readings(clock, sending((n for n in range(12_000) if rng.random() > 0.05), late))
    assert clock.reanchored == 0


@pytest.mark.parametrize("phase_us", [0, 1000, 2500, 4900])
def test_after_a_pause_the_phase_is_found_again(phase_us: int, seed: int) -> None:
    rng = random.Random(seed)
    clock = CyclicClock[int](0.005)
    readings(clock, sending(range(3000), lambda: rng.expovariate(1 / 300)), last=False)
    frames = sending(range(10_000, 14_000), lambda: rng.expovariate(1 / 300), start_us=START_US + 3600e6 + phase_us)
    found = readings(clock, frames)
    assert clock.reanchored == 1
    assert len(rejected(found)) < 10
    given_us = times(found)
    assert all(a < b for a, b in itertools.pairwise(given_us.values()))
    ends = [given_us[c] - f.sent_us for f in frames[200:] if (c := f.cycle) in given_us]
    assert sum(abs(off - 30) > 500 for off in ends) < 10


def test_a_step_of_the_host_s_clock_within_a_cycle_is_followed() -> None:
    rng = random.Random(1)
    clock = CyclicClock[int](0.005)
    readings(clock, sending(range(6000), lambda: rng.uniform(0, 500)), last=False)
    frames = sending(range(6000, 12_000), lambda: rng.uniform(0, 500), start_us=START_US + 2300)
    found, known = list[Reading](), set[float | None]()
    for frame in frames:
        found += readings(clock, [frame], last=False)
        known.add(clock.interval_s)
    assert not rejected(found)
    assert [s for s in known if s is not None] == pytest.approx([0.005] * (len(known) - 1), rel=60e-6)
    given_us = times(found)
    assert all(abs(given_us[f.cycle] - f.sent_us) < 600 for f in frames[-1000:])


def test_where_the_first_frame_was_late_the_line_is_soon_with_the_others() -> None:
    late = iter([1200.0])
    found = times(readings(CyclicClock(0.005), sending(range(300), lambda: next(late, 0.0))))
    assert found[0] == START_US + 1200
    assert all(abs(found[c] - START_US - c * CYCLE_US) <= 1 for c in range(10, 300))


def test_the_rate_is_known_from_before_when_the_clock_is_set_back_and_what_was_held_is_not_lost() -> None:
    clock, cycle_us = CyclicClock[int](0.005), CYCLE_US * (1 + 750e-6)
    readings(clock, sending(range(3000), on_time, cycle_us), last=False)
    assert readings(clock, sending([3002], on_time, cycle_us), last=False) == []
    frames = sending(range(3003, 3303), on_time, cycle_us, START_US - 60e6)
    found = readings(clock, frames)
    first = next(k for k, reading in enumerate(found) if reading.time != "untimed")
    assert found[first].cycle == 3002
    given_us = [reading.time for reading in found[first + 1 :] if isinstance(reading.time, int)]
    assert len(given_us) > 90
    assert given_us[90] - given_us[0] == pytest.approx(90 * cycle_us, abs=20)  # 340 by the nominal cycle


@settings(max_examples=15)
@given(
    chance=st.randoms(use_true_random=False),
    jitter_us=st.integers(0, 20_000),
    ppm=st.floats(-3000, 3000),
    jumps_us=st.lists(st.integers(-5_000_000, 5_000_000), max_size=3),
)
def test_whatever_comes_every_frame_is_told_of_once_and_times_rise_between_restarts(
    chance: random.Random, jitter_us: int, ppm: float, jumps_us: list[int]
) -> None:
    start_us, cycle, frames = float(START_US), 0, list[Sent]()
    for jump_us in (0, *jumps_us):
        start_us += jump_us
        cycles = [cycle + n for n in range(chance.randint(1, 400)) if chance.random() > 0.1]
        late = lambda: chance.uniform(0, jitter_us)  # noqa: E731
        frames += sending(cycles, late, CYCLE_US * (1 + ppm * 1e-6), start_us)
        cycle += 400
    clock = CyclicClock[int](0.005)
    found = readings(clock, frames)
    assert sorted(reading.cycle for reading in found) == [frame.cycle for frame in frames]
    given_us = list(times(found).values())
    assert sum(a >= b for a, b in itertools.pairwise(given_us)) <= clock.reanchored
    assert {str(reading.time) for reading in rejected(found)} <= {"repeated", "out_of_order", "untimed"}
    assert readings(CyclicClock(0.005), frames) == found  # nothing but times of receipt counts
