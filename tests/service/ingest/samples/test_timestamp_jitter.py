"""The scatter and the interval of time stamps, and what is recommended for the configuration."""

import itertools
import random
from collections.abc import Iterable
from typing import Any

import pytest

from monitor_core.kernel.compile import entry
from monitor_core.sampling import new_meter
from monitor_core.sampling.stamp_meter import frame_received, sample_timed
from service.ingest.samples.timestamp_jitter import NOT_KNOWN, ClockKind, Stamps, in_words, remarks, stamps_of
from tests.core.sampling.single_frames import SampleClock

START_US = 1_760_000_000_000_000


@entry
def _meter(meter: Any, received_us: int, time_us: int, timed: bool) -> None:
    if timed:
        sample_timed(meter[0], received_us, time_us)
    else:
        frame_received(meter[0], received_us)


class StampMeter:
    """Scatter of stamps."""

    def __init__(self, interval_s: float) -> None:
        self._meter = new_meter(interval_s)

    def received(self, t_us: int) -> None:
        _meter(self._meter, t_us, 0, False)

    def timed(self, received_us: int, time_us: int) -> None:
        _meter(self._meter, received_us, time_us, True)

    def stamps(self, clock: ClockKind, fitted_s: float | None = None, counted_s: float | None = None) -> Stamps:
        return stamps_of(self._meter, clock, fitted_s, counted_s)


def meter(rng: random.Random, scatter_us: float, interval_us: float, frames: int = 4000) -> StampMeter:
    """After frames that scatter to both sides, each by itself, of which some are lost and some waited."""
    found = StampMeter(0.005)
    for n in range(frames):
        sent_us = START_US + round(n * interval_us)
        received_us = round(sent_us + rng.gauss(0, scatter_us))
        if rng.random() > 0.01:
            found.received(received_us)
            found.timed(received_us, sent_us)
        if n % 500 == 0:
            for k in range(10):
                found.received(received_us + 20 * k)
    return found


@pytest.mark.parametrize("clock", ["receipt", "cyclic", "counter"])
@pytest.mark.parametrize("scatter_us", [100, 400])
def test_the_scatter_is_that_of_the_stamps_whatever_gives_the_times(clock: str, scatter_us: float, seed: int) -> None:
    stamps = meter(random.Random(seed), scatter_us, 5000).stamps(clock)  # type: ignore[arg-type]
    # Of a thousand and more: 2 % by chance; at the beginning of a burst an interval is not the usual one.
    assert stamps.scatter_s == pytest.approx(scatter_us * 1e-6, rel=0.15)


def test_the_scatter_of_long_ago_is_forgotten(seed: int) -> None:
    rng, found = random.Random(seed), StampMeter(0.005)
    for n in range(12_000):
        found.timed(START_US + round(rng.gauss(0, 2000 if n < 2000 else 100)), START_US)
    assert found.stamps("cyclic").scatter_s == pytest.approx(100e-6, rel=0.15)


def test_nothing_is_said_before_it_is_known() -> None:
    found = StampMeter(0.005)
    for n in range(50):
        found.received(START_US + 5000 * n)
        found.timed(START_US + 5000 * n, START_US)
    assert found.stamps("receipt") == NOT_KNOWN
    assert found.stamps("counter") == Stamps("counter", None, None)
    assert list(remarks(0.005, NOT_KNOWN)) == []
    assert in_words(NOT_KNOWN) == ("nothing yet", "")


def test_stamps_that_scatter_are_told_with_what_would_help(seed: int) -> None:
    stamps = meter(random.Random(seed), 400, 5000).stamps("receipt")
    (words,) = remarks(0.005, stamps)
    assert words.startswith("stamps scatter by 0.")
    assert 'set clock = "cyclic" in [robot.axis.time], or counter_message' in words
    assert list(remarks(0.005, stamps._replace(clock="cyclic", interval_s=0.005))) == []
    assert list(remarks(0.005, stamps._replace(scatter_s=0.0002))) == []
    (words,) = remarks(0.005, stamps._replace(scatter_s=0.001, interval_s=0.00515))
    assert "sample_interval_s" not in words


@pytest.mark.parametrize("scatter_us", [20, 400, 1000])
def test_an_interval_that_is_not_the_nominal_one_is_told_and_no_other(scatter_us: float, seed: int) -> None:
    rng = random.Random(seed)
    right = meter(rng, scatter_us, 5000).stamps("receipt")
    assert all("sample_interval_s" not in words for words in remarks(0.005, right))
    wrong = meter(rng, scatter_us, 5500).stamps("receipt")
    assert wrong.interval_s == pytest.approx(0.0055, rel=0.03)
    assert any("ms, not every 5 ms: correct sample_interval_s" in w for w in remarks(0.005, wrong))


@pytest.mark.parametrize(("ppm", "count"), [(100, 0), (-200, 0), (750, 1), (-400, 1)])
def test_a_clock_that_is_further_off_than_crystals_are_is_told(ppm: float, count: int) -> None:
    stamps = Stamps("cyclic", 1e-4, 0.005 * (1 + ppm * 1e-6))
    assert len(list(remarks(0.005, stamps))) == count


def test_a_clock_that_cannot_be_fitted_gives_way_to_the_intervals(seed: int) -> None:
    found = meter(random.Random(seed), 50, 5500)
    assert found.stamps("cyclic", 0.00501).interval_s == pytest.approx(0.0055, rel=0.01)
    assert meter(random.Random(seed), 50, 5000).stamps("cyclic", 0.00501).interval_s == 0.00501


def counted(received_us: Iterable[float]) -> Stamps:
    """The stamps of a counter of 5 ms after frames that were received at these times."""
    clock, found = SampleClock(0.005, 16), StampMeter(0.005)
    for n, at_us in enumerate(received_us):
        found.received(START_US + round(at_us))
        time_us = clock.read(START_US + round(at_us), n % 65536)
        if isinstance(time_us, int):
            found.timed(START_US + round(at_us), time_us)
    return found.stamps("counter", clock.interval_s, clock.time_per_count_s)


@pytest.mark.parametrize("frames", [1500, 2000, 5000])
def test_frames_that_catch_up_do_not_change_the_interval_of_a_counter(frames: int) -> None:
    # A busy sender stalls for 0.1 s every half a second, and then sends faster, until it is on time again.
    sent, at_us = list[float](), 0.0
    for n in range(frames):
        stalled = 100_000.0 if n % 100 == 0 else 0.0
        at_us = max(5000.0 * n + stalled, at_us + 3500.0)
        sent.append(at_us)
    steps = [b - a for a, b in itertools.pairwise(sent)]
    assert sorted(steps)[len(steps) // 2] == 3500.0  # most intervals are short
    assert list(remarks(0.005, counted(sent))) == []


@pytest.mark.parametrize("clock", ["counter", "cyclic"])
def test_scatter_is_no_other_interval_before_the_clock_is_fitted(clock: Any, seed: int) -> None:
    stamps = meter(random.Random(seed), 300, 5000, 2000).stamps(clock)
    assert stamps.interval_s is not None
    for ppm in (1e6 * (stamps.interval_s / 0.005 - 1), 800.0, -800.0):  # a median is not known to 300 ppm
        assert list(remarks(0.005, stamps._replace(interval_s=0.005 * (1 + 1e-6 * ppm)))) == []


@pytest.mark.parametrize("frames", [1500, 2000, 5000, 20_000])
@pytest.mark.parametrize("interval_us", [4800.0, 5200.0])
def test_a_wrong_interval_of_a_counter_is_told(interval_us: float, frames: int, seed: int) -> None:
    rng = random.Random(seed)
    stamps = counted(interval_us * n + abs(rng.gauss(0, 300)) for n in range(frames))
    assert stamps.interval_s == pytest.approx(interval_us * 1e-6, rel=0.01)
    assert any("correct sample_interval_s" in words for words in remarks(0.005, stamps))
