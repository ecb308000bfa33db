"""How far stamps scatter, and what that says."""

import random

import pytest

from service.ingest.timestamp_jitter import NOT_KNOWN, StampMeter, Stamps, in_words, remarks

START_US = 1_760_000_000_000_000


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
def test_the_scatter_is_that_of_the_stamps_whatever_gives_the_times(
    clock: str, scatter_us: float, seed: int
) -> None:
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
    assert list(remarks("r.one", 0.005, NOT_KNOWN)) == []
    assert in_words(NOT_KNOWN) == ("nothing yet", "")


def test_stamps_that_scatter_are_told_with_what_would_help(seed: int) -> None:
    stamps = meter(random.Random(seed), 400, 5000).stamps("receipt")
    (words,) = remarks("r.one", 0.005, stamps)
    assert words.startswith("r.one: stamps scatter by 0.")
    assert 'set clock = "cyclic" in [robot.axis.time], or counter_message' in words
    assert list(remarks("r.one", 0.005, stamps._replace(clock="cyclic", interval_s=0.005))) == []
    assert list(remarks("r.one", 0.005, stamps._replace(scatter_s=0.0002))) == []
    (words,) = remarks("r.one", 0.005, stamps._replace(scatter_s=0.001, interval_s=0.00515))
    assert "sample_interval_s" not in words


@pytest.mark.parametrize("scatter_us", [20, 400, 1000])
def test_an_interval_that_is_not_the_nominal_one_is_told_and_no_other(scatter_us: float, seed: int) -> None:
    rng = random.Random(seed)
    right = meter(rng, scatter_us, 5000).stamps("receipt")
    assert all("sample_interval_s" not in words for words in remarks("r.one", 0.005, right))
    wrong = meter(rng, scatter_us, 5500).stamps("receipt")
    assert wrong.interval_s == pytest.approx(0.0055, rel=0.03)
    assert any("ms, not every 5 ms: correct sample_interval_s" in w for w in remarks("r.one", 0.005, wrong))


@pytest.mark.parametrize(("ppm", "said"), [(100, 0), (-200, 0), (750, 1), (-400, 1)])
def test_a_clock_that_is_further_off_than_crystals_are_is_told(ppm: float, said: int) -> None:
    stamps = Stamps("cyclic", 1e-4, 0.005 * (1 + ppm * 1e-6))
    assert len(list(remarks("r.one", 0.005, stamps))) == said


def test_a_clock_that_cannot_be_fitted_gives_way_to_the_intervals(seed: int) -> None:
    found = meter(random.Random(seed), 50, 5500)
    assert found.stamps("cyclic", 0.00501).interval_s == pytest.approx(0.0055, rel=0.01)
    assert meter(random.Random(seed), 50, 5000).stamps("cyclic", 0.00501).interval_s == 0.00501
