"""A sample counter becomes time: whole intervals, whatever the jitter of receipt."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.ingest.clock import SampleClock

START_US = 1_760_000_000_000_000


@given(
    bits=st.sampled_from([4, 8, 16, 32]),
    first=st.integers(0, 2**32),
    steps=st.lists(st.integers(1, 7), min_size=1, max_size=60),
    jitter=st.lists(st.integers(0, 9000), min_size=60, max_size=60),
)
def test_lost_samples_and_jitter_leave_whole_intervals(
    bits: int, first: int, steps: list[int], jitter: list[int]
) -> None:
    clock = SampleClock(0.005, bits)
    assert clock.read(START_US, first % 2**bits) == START_US
    n = 0
    for step, late_us in zip(steps, jitter, strict=False):
        n += step
        assert clock.read(START_US + 5000 * n + late_us, (first + n) % 2**bits) == START_US + 5000 * n
    assert clock.reanchored == 0


def test_no_drift_with_an_interval_that_is_no_whole_microsecond(seed: int) -> None:
    clock, interval_s, rng = SampleClock(1 / 3000, 16), 1 / 3000, random.Random(seed)
    clock.read(START_US, 0)
    for n in range(1, 200_000):
        received_us = START_US + round(n * interval_s * 1e6) + rng.randrange(100)
        time_us = clock.read(received_us, n % 65536)
    assert time_us == START_US + round(199_999 * interval_s * 1e6)


def test_repeated_and_late_counts_are_told_apart() -> None:
    clock = SampleClock(0.005, 8)
    assert clock.read(START_US, 254) == START_US
    assert clock.read(START_US + 5000, 255) == START_US + 5000
    assert clock.read(START_US + 5100, 255) == "repeated"
    assert clock.read(START_US + 10_000, 0) == START_US + 10_000
    assert clock.read(START_US + 10_100, 255) == "out_of_order"
    assert clock.read(START_US + 15_000, 1) == START_US + 15_000


def test_a_pause_longer_than_the_counter_wraps() -> None:
    clock = SampleClock(0.005, 8)
    clock.read(START_US, 10)
    later = 256 * 7 + 3
    assert clock.read(START_US + later * 5000 + 800, 13) == START_US + later * 5000
    assert clock.reanchored == 0


@pytest.mark.parametrize("jump_s", [0.8, -0.8, 3600.0])
def test_a_counter_that_goes_its_own_way_is_anchored_anew(jump_s: float) -> None:
    clock = SampleClock(0.005, 32)
    clock.read(START_US, 1_000_000)
    received_us = START_US + 5000
    assert clock.read(received_us, 1_000_001 + round(jump_s / 0.005)) == received_us
    assert clock.reanchored == 1
    assert clock.read(received_us + 5300, 1_000_002 + round(jump_s / 0.005)) == received_us + 5000


def test_a_slow_drift_is_followed_in_steps_of_half_a_second() -> None:
    clock = SampleClock(0.005, 16)  # the controller's clock is 1 % slow
    received = [START_US + 5050 * n for n in range(30_000)]
    times = [clock.read(t_us, n % 65536) for n, t_us in enumerate(received)]
    assert clock.reanchored == 2
    assert all(isinstance(t, int) and -5050 <= r - t <= 505_050 for t, r in zip(times, received, strict=True))
