"""What a warm-up model lacks, on windows whose friction follows a law that is known."""

from __future__ import annotations

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.identification.thermal.warm_up import model_errors
from monitor_core.identification.thermal.warm_up_search import Search, heat_course
from monitor_core.identification.thermal.warm_up_windows import WINDOW_S, Windows

CHANCE = 0.03
"""Standard deviation of a parameter in one window."""
INDEX = [0]
NIGHT_S = 50_000.0


def record(rng: np.random.Generator, taus_s: tuple[float, ...], fall: float, minutes: int = 40) -> Windows:
    """From cold on, with a first parameter that falls by shares of each heat, and a second one that does not."""
    power = rng.uniform(10.0, 20.0, 6 * minutes)
    heats: list[Floats] = [heat_course(power, 0.0, tau_s)[0] for tau_s in taus_s]
    delta = np.zeros((power.size, 2))
    delta[:, 0] = -fall * np.mean(heats, axis=0) / 15.0
    information = np.repeat(np.eye(2)[np.newaxis] / CHANCE**2, power.size, axis=0)
    score = (delta + rng.normal(0, CHANCE, delta.shape)) / CHANCE**2
    middle_s = np.asarray((np.arange(power.size) + 0.5) * WINDOW_S, np.float64)
    return Windows(middle_s, power, information, score)


def errors(seed: int, taus_s: tuple[float, ...], fall: float, records: int = 2, minutes: int = 40) -> Floats:
    rng = np.random.default_rng(seed)
    windows = [record(rng, taus_s, fall, minutes) for _ in range(records)]
    return model_errors(Search(windows, INDEX, [None, *[NIGHT_S] * (records - 1)], "cold"), INDEX)


def test_what_one_time_constant_lacks_of_two_is_found(seed: int) -> None:
    """Minutes and an hour: chance is 0.012 in a group of six windows, what one time constant lacks is larger."""
    exact, lacking = (errors(seed, taus_s, 0.5)[0] for taus_s in ((500.0,), (90.0, 3000.0)))
    assert exact < 0.018
    assert lacking > 2 * exact


def test_a_parameter_that_follows_nothing_is_judged_too(seed: int) -> None:
    found = errors(seed, (500.0,), 0.5)
    assert 0 < found[1] < 0.018


def test_one_record_is_judged_by_its_beginning(seed: int) -> None:
    exact, lacking = (errors(seed, taus_s, 0.5, records=1)[0] for taus_s in ((500.0,), (90.0, 3000.0)))
    assert 0 < exact < lacking


def test_the_less_there_is_to_judge_by_the_larger_it_may_be(seed: int) -> None:
    long, short = (errors(seed, (120.0,), 0.5, minutes=minutes)[1] for minutes in (60, 10))
    assert long < short


def test_records_too_short_to_judge_say_nothing(seed: int) -> None:
    assert np.isnan(errors(seed, (120.0,), 0.5, records=1, minutes=3)).all()


@pytest.mark.parametrize("known", [NIGHT_S, None], ids=["a known pause", "an unknown start"])
def test_a_record_that_begins_warm_is_judged_from_its_likeliest_heat(seed: int, known: float | None) -> None:
    rng = np.random.default_rng(seed)
    windows = [record(rng, (500.0,), 0.5) for _ in range(2)]
    found = model_errors(Search(windows, INDEX, [None, known], "cold"), INDEX)
    assert found[0] < 0.018


def test_another_hall_is_no_error_of_the_law(seed: int) -> None:
    """The daemon observes it; so it does not count, neither in a record that is judged by the others."""
    rng = np.random.default_rng(seed)
    alike = [record(rng, (500.0,), 0.5) for _ in range(2)]
    colder = alike[1]._replace(score=alike[1].score + np.array([0.1, 0.0]) / CHANCE**2)
    found = [
        model_errors(Search([alike[0], w], INDEX, [None, NIGHT_S], "cold", halls=True), INDEX)[0]
        for w in (alike[1], colder)
    ]
    assert found[1] < 1.1 * found[0]
