"""Times of samples by the counter of a controller."""

import itertools
import random
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor_core.sampling.clock_line import SLEW
from tests.core.sampling.single_frames import SampleClock

START_US = 1_760_000_000_000_000


@settings(max_examples=30)
@given(
    bits=st.sampled_from([4, 8, 16, 32]),
    first=st.integers(0, 2**32),
    steps=st.lists(st.integers(1, 7), min_size=1, max_size=60),
    seed=st.integers(0, 2**32),  # to draw each lateness takes longer than all the rest
)
def test_lost_samples_and_jitter_leave_whole_intervals(bits: int, first: int, steps: list[int], seed: int) -> None:
    clock, rng = SampleClock(0.005, bits), random.Random(seed)
    assert clock.read(START_US, first % 2**bits) == START_US
    n = 0
    for step in steps:
        n += step
        late_us = rng.choice([0, 9000, rng.randint(0, 9000)])
        assert clock.read(START_US + 5000 * n + late_us, (first + n) % 2**bits) == START_US + 5000 * n
    assert clock.reanchored == 0


def test_no_drift_with_an_interval_that_is_no_whole_microsecond(seed: int) -> None:
    clock, interval_s, rng = SampleClock(1 / 3000, 16), 1 / 3000, random.Random(seed)
    clock.read(START_US, 0)
    for n in range(1, 200_000):
        received_us = START_US + round(n * interval_s * 1e6) + rng.randrange(100)
        time_us = clock.read(received_us, n % 65536)
    assert time_us == START_US + round(199_999 * interval_s * 1e6)


def test_a_pause_longer_than_the_counter_counts() -> None:
    clock = SampleClock(0.005, 8)
    clock.read(START_US, 10)
    later = 256 * 7 + 3
    assert clock.read(START_US + later * 5000 + 800, 13) == START_US + later * 5000
    assert clock.reanchored == 0


class Controller:
    """Counts with a crystal of its own; its frames are received as the clock of this machine goes."""

    def __init__(self, bits: int = 16, ppm: float = 0.0, count: int = 0) -> None:
        self.bits, self.count = bits, count
        self.interval_us = 5000 * (1 + ppm * 1e-6)
        self.sent_us = float(START_US)

    def send(self, counts: int = 1) -> tuple[int, int]:
        """When the next frame is sent, and its count."""
        self.count += counts
        self.sent_us += counts * self.interval_us
        return round(self.sent_us), self.count % 2**self.bits


def times_of(clock: SampleClock, frames: Iterable[tuple[int, int]]) -> list[int]:
    """The times of those frames that have one."""
    read = (clock.read(received_us, raw) for received_us, raw in frames)
    return [time_us for time_us in read if isinstance(time_us, int)]


@pytest.mark.parametrize(("ppm", "counts", "frames"), [(-100, 400, 86_400), (100, 400, 86_400), (80, 1, 40_000)])
def test_crystals_that_differ_are_followed_and_intervals_hardly_change(
    ppm: int, counts: int, frames: int, seed: int
) -> None:
    """For two days with a frame every two seconds, and sample by sample."""
    clock, controller, rng = SampleClock(0.005, 16), Controller(ppm=ppm), random.Random(seed)
    (before_us,), off = times_of(clock, [controller.send()]), []
    for _ in range(frames):
        sent_us, raw = controller.send(counts)
        time_us = clock.read(sent_us + rng.randrange(3000), raw)
        assert isinstance(time_us, int)
        assert abs(time_us - before_us - counts * 5000) <= counts * 5000 * SLEW + 1
        off.append(time_us - sent_us)
        before_us = time_us
    assert clock.reanchored == 0
    assert -5000 < min(off) <= max(off) < 5000


@settings(max_examples=20)
@given(
    ppm=st.floats(-100, 100),
    jitter_us=st.integers(0, 20_000),
    stalls=st.lists(st.tuples(st.integers(300, 2000), st.floats(0.01, 3.0)), max_size=4),
    jump=st.integers(-60, 60) | st.integers(300, 2**15) | st.integers(-(2**15), -300),
    chance=st.randoms(use_true_random=False),
)
def test_whatever_happens_times_rise_and_come_back_to_the_truth(
    ppm: float, jitter_us: int, stalls: list[tuple[int, float]], jump: int, chance: random.Random
) -> None:
    clock, controller = SampleClock(0.005, 16), Controller(ppm=ppm)
    frames: list[tuple[int, int, int]] = []  # sent, received, count
    for length, stall_s in stalls:
        frames += [receive(controller, chance.randint(0, jitter_us)) for _ in range(length)]
        frames += late(controller, stall_s)
    frames += [receive(controller, chance.randint(0, jitter_us)) for _ in range(600)]
    controller.count += jump
    frames += [receive(controller, chance.randint(0, jitter_us)) for _ in range(600)]
    given_us = [(clock.read(received_us, raw), sent_us) for sent_us, received_us, raw in frames]
    times = [(time_us, sent_us) for time_us, sent_us in given_us if isinstance(time_us, int)]
    assert all(a < b for (a, _), (b, _) in itertools.pairwise(times))
    assert clock.reanchored == (abs(jump) > 60)
    assert all(isinstance(time_us, int) for time_us, _ in given_us[-300:])
    allowed_us = 25_000 if clock.reanchored else 25_000 + 5000 * abs(jump)
    assert all(abs(time_us - sent_us) < allowed_us for time_us, sent_us in times[-300:])
    again = SampleClock(0.005, 16)
    assert [again.read(received_us, raw) for _, received_us, raw in frames] == [t for t, _ in given_us]


def receive(controller: Controller, late_us: int) -> tuple[int, int, int]:
    sent_us, raw = controller.send()
    return sent_us, sent_us + late_us, raw


def late(controller: Controller, stall_s: float) -> list[tuple[int, int, int]]:
    """Frames that are received, and stamped, in one burst after the host was held up for so long."""
    sent = [controller.send() for _ in range(round(stall_s / 0.005))]
    end_us = sent[-1][0]
    return [(sent_us, end_us + 20 * k, raw) for k, (sent_us, raw) in enumerate(sent)]


@pytest.mark.parametrize(("stall_s", "lost"), [(0.4, 0), (3.0, 1)])
def test_a_host_that_was_held_up_is_on_the_old_line_afterwards(stall_s: float, lost: int) -> None:
    clock, controller = SampleClock(0.005, 16), Controller()
    frames = [receive(controller, 0) for _ in range(100)]
    frames += late(controller, stall_s) + [receive(controller, 0) for _ in range(100)]
    read = [(clock.read(received_us, raw), sent_us) for sent_us, received_us, raw in frames]
    times = [(time_us, sent_us) for time_us, sent_us in read if isinstance(time_us, int)]
    assert all(time_us == sent_us for time_us, sent_us in times)
    assert len(frames) - len(times) == lost
    assert {t for t, _ in read if not isinstance(t, int)} <= {"untimed"}
    assert clock.reanchored == 0


@pytest.mark.parametrize("jump_s", [0.8, -0.8, 100.0])
@pytest.mark.parametrize("what", ["counter", "receipt"])
def test_a_jump_that_lasts_starts_the_line_anew(what: str, jump_s: float) -> None:
    clock, controller = SampleClock(0.005, 32), Controller(32, count=1_000_000)
    times_of(clock, [controller.send() for _ in range(10)])
    if what == "counter":
        controller.count += round(jump_s / 0.005)
    else:
        controller.sent_us += jump_s * 1e6
    frames = [controller.send() for _ in range(400)]
    read = [clock.read(*frame) for frame in frames]
    assert read[:200] == ["untimed"] * 200
    assert read[200:] == [sent_us for sent_us, _ in frames[200:]]
    assert clock.reanchored == 1


def test_a_single_wrong_count_is_passed_over() -> None:
    clock, controller = SampleClock(0.005, 32), Controller(32)
    frames = [controller.send() for _ in range(20)]
    frames[10] = (frames[10][0], 77_000)
    assert times_of(clock, frames) == [sent_us for sent_us, raw in frames if raw != 77_000]
    assert clock.reanchored == 0


def test_a_clock_that_is_set_back_while_a_jump_is_doubted() -> None:
    clock, controller = SampleClock(0.005, 32), Controller(32)
    times_of(clock, [controller.send() for _ in range(10)])
    controller.sent_us += 10e6
    assert times_of(clock, [controller.send() for _ in range(100)]) == []
    controller.sent_us -= 3600e6
    frames = [controller.send() for _ in range(300)]
    assert times_of(clock, frames) == [sent_us for sent_us, _ in frames[200:]]


def test_a_wrong_sample_interval_is_told_by_the_counters() -> None:
    clock = SampleClock(0.005, 16)  # the controller sends every 5.05 ms
    read = [clock.read(START_US + 5050 * n, n % 65536) for n in range(30_000)]
    assert clock.reanchored == 2
    assert read.count("untimed") == pytest.approx(400, abs=10)


def test_the_frame_that_a_line_begins_with_may_have_been_late() -> None:
    clock = SampleClock(0.005, 16)
    for n in range(10_000):
        clock.read(START_US + 5000 * n + (15_000 if n == 0 else n % 3), n)
    assert clock.interval_s == pytest.approx(0.005, rel=1e-6)
