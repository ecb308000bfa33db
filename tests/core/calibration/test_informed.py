"""Records and their copies together: chance is taken for chance, and what the copies do not know for what it is."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.copy_excursions import Excursions
from monitor_core.calibration.scatter import Scatter
from monitor_core.calibration.shrinkage import shrink
from tests.shares import soaked

P = 3


def copies(mean: Floats, sigma: Floats, off: float = 0.0) -> Excursions:
    """That are off by so much themselves: the mean in sigma, and the logarithm of sigma."""
    error = off**2 * np.eye(2 * P)
    return Excursions(np.ones(P), sigma, mean, error, ((np.zeros(0),) * P,) * 2, 1e6)


def record(rng: np.random.Generator, mean: Floats, sigma: Floats, memories: float) -> Scatter:
    """Of such a true scatter, as a record that long tells it."""
    sd = sigma * np.sqrt(2 / memories)
    of_log = 1 / np.sqrt(memories)  # of the variance, doubled in its logarithm
    seen = sigma * np.exp(of_log / 2 * rng.standard_normal(P))
    power = np.exp(of_log * rng.standard_normal((1000, P)))
    off = sd * rng.standard_normal((1000, P))
    return Scatter(mean + sd * rng.standard_normal(P), np.ones(P), seen, power, off, memories, 200.0)


def test_the_bias_that_the_copies_have_is_told_better_than_by_the_record(seed: int) -> None:
    """Mean and size of 200 short records whose copies are right: off by at most three quarters of what they were."""
    rng = np.random.default_rng(seed)
    mean, sigma = np.array([-0.3, 0.0, 0.2]), np.array([1.0, 2.0, 0.5])
    off: list[list[Floats]] = []
    for _ in range(200):
        raw = record(rng, mean, sigma, 200)
        shrunk = shrink(raw, copies(mean, sigma), rng)
        off.append(
            [estimate.mean_d - mean for estimate in (raw, shrunk)]
            + [np.log(estimate.sigma / sigma) for estimate in (raw, shrunk)]
        )
    raw_mean, shrunk_mean, raw_log, shrunk_log = np.sqrt(np.mean(np.square(off), axis=0))
    print(f"mean off by {raw_mean}, then {shrunk_mean}; logarithm of sigma {raw_log}, then {shrunk_log}")
    assert (shrunk_mean < 0.75 * raw_mean).all()
    assert (shrunk_log < 0.75 * raw_log).all()


def test_copies_of_another_model_are_not_believed(seed: int) -> None:
    """Copies with another mean and with one and a half times the scatter, as of a model that lacks friction."""
    rng = np.random.default_rng(seed)
    mean, sigma = np.array([0.05, 0.05, 0.05]), np.array([0.05, 0.05, 0.05])
    raw = record(rng, mean, sigma, 200)
    shrunk = shrink(raw, copies(-mean, 1.5 * sigma), rng)
    assert shrunk.mean_d == pytest.approx(raw.mean_d, abs=0.2 * raw.off.std(axis=0).max())
    assert shrunk.sigma == pytest.approx(raw.sigma, rel=0.03)
    assert shrunk.off.std(axis=0) == pytest.approx(raw.off.std(axis=0), rel=0.05)
    assert (
        abs(shrunk.off.mean(axis=0)) < 0.2 * shrunk.off.std(axis=0)
    ).all()  # the mean is no part of what it may be off by


@pytest.mark.parametrize("own", soaked([0.02, 0.05], 0.05))
def test_what_copies_are_off_by_themselves_stays(own: float, seed: int) -> None:
    """The record is off by that, too, and by its own: an interval of 90 % holds the truth in 90 of 100, or more."""
    rng = np.random.default_rng(seed)
    mean, sigma, held, times = np.zeros(P), np.array([1.0, 2.0, 0.5]), np.zeros(P), 300
    for _ in range(times):
        off = own * rng.standard_normal(P) * sigma
        chance = record(rng, mean, sigma, 200)
        rest = np.sqrt(1 - own**2 / (2 / 200))  # of the record's chance
        raw = replace(chance, mean_d=off + rest * chance.mean_d)
        shrunk = shrink(raw, copies(mean + off, sigma, own), rng)
        held += np.abs(shrunk.mean_d - mean) < 1.645 * shrunk.off.std(axis=0)
    print(f"{100 * held / times} of 100 hold the truth")
    assert (held / times > 0.84).all()
    assert (shrunk.off.std(axis=0) > 0.9 * own * sigma).all()


def test_errors_of_copies_go_together(seed: int) -> None:
    """More colour, more bias and more scatter: so the rate of the axis is less certain than by each alone."""
    rng = np.random.default_rng(seed)
    found = copies(np.zeros(P), np.ones(P), 0.04)
    together = 0.04**2 * np.ones((2 * P, 2 * P))
    seen = []
    for _ in range(20):
        shrunk = shrink(record(rng, np.zeros(P), np.ones(P), 400), replace(found, error=together), rng)
        seen.append(np.corrcoef(np.hstack([shrunk.off, np.log(shrunk.power)]).T))
    assert (np.mean(seen, axis=0) > 0.2).all()
