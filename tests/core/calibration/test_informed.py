"""Records and their copies together: chance is taken for chance, and what the copies do not know for what it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from monitor_core.calibration.informed import informed, shrunk
from monitor_core.calibration.scatter import Scatter
from monitor_core.calibration.surrogate import Excursions
from monitor_core.kernel.tables import Floats

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


def test_shrunk_is_the_posterior_of_the_horseshoe() -> None:
    """By quadrature over the scale tau, half Cauchy, of what differs."""

    def moment(power: int, e: float) -> float:
        def density(tau: float) -> float:
            v = tau**2 / (1 + tau**2)
            moments = (1.0, v * e, v + (v * e) ** 2)
            likelihood = np.exp(-(e**2) / (2 * (1 + tau**2))) / np.sqrt(1 + tau**2)
            return float(moments[power] * likelihood / (1 + tau**2))

        return float(quad(density, 0, np.inf, limit=200)[0])

    for e in (0.0, 0.7, -2.0, 4.0):
        mean, sd = shrunk(np.array([e]))
        expected = moment(1, e) / moment(0, e)
        assert mean[0] == pytest.approx(expected, abs=1e-4)
        assert sd[0] == pytest.approx(np.sqrt(moment(2, e) / moment(0, e) - expected**2), abs=1e-4)


def test_what_is_far_out_is_left_alone() -> None:
    e = np.array([-1e9, -30.0, 30.0, 1e9])
    mean, sd = shrunk(e)
    assert mean == pytest.approx(e, rel=3e-3)
    assert sd == pytest.approx(np.ones(4), abs=3e-3)


def test_the_bias_that_the_copies_have_is_told_better_than_by_the_record(seed: int) -> None:
    """Mean and size of 200 short records whose copies are right: off by at most three quarters of what they were."""
    rng = np.random.default_rng(seed)
    mean, sigma = np.array([-0.3, 0.0, 0.2]), np.array([1.0, 2.0, 0.5])
    off: list[list[Floats]] = []
    for _ in range(200):
        raw = record(rng, mean, sigma, 200)
        told = informed(raw, copies(mean, sigma), rng)
        off.append(
            [one.mean_d - mean for one in (raw, told)] + [np.log(one.sigma / sigma) for one in (raw, told)]
        )
    raw_mean, told_mean, raw_log, told_log = np.sqrt(np.mean(np.square(off), axis=0))
    print(f"mean off by {raw_mean}, then {told_mean}; logarithm of sigma {raw_log}, then {told_log}")
    assert (told_mean < 0.75 * raw_mean).all()
    assert (told_log < 0.75 * raw_log).all()


def test_copies_of_another_model_are_not_believed(seed: int) -> None:
    """Copies with another mean and with one and a half times the scatter, as of a model that lacks friction."""
    rng = np.random.default_rng(seed)
    mean, sigma = np.array([0.05, 0.05, 0.05]), np.array([0.05, 0.05, 0.05])
    raw = record(rng, mean, sigma, 200)
    told = informed(raw, copies(-mean, 1.5 * sigma), rng)
    assert told.mean_d == pytest.approx(raw.mean_d, abs=0.2 * raw.mean_sd.max())
    assert told.sigma == pytest.approx(raw.sigma, rel=0.03)
    assert told.mean_sd == pytest.approx(raw.mean_sd, rel=0.05)


@pytest.mark.parametrize("own", [0.02, 0.05])
def test_what_copies_are_off_by_themselves_stays(own: float, seed: int) -> None:
    """The record is off by that, too, and by its own: an interval of 90 % holds the truth in 90 of 100, or more."""
    rng = np.random.default_rng(seed)
    mean, sigma, held, times = np.zeros(P), np.array([1.0, 2.0, 0.5]), np.zeros(P), 300
    for _ in range(times):
        off = own * rng.standard_normal(P) * sigma
        chance = record(rng, mean, sigma, 200)
        rest = np.sqrt(1 - own**2 / (2 / 200))  # of the record's chance
        raw = replace(chance, mean_d=off + rest * chance.mean_d)
        told = informed(raw, copies(mean + off, sigma, own), rng)
        held += np.abs(told.mean_d - mean) < 1.645 * told.mean_sd
    print(f"{100 * held / times} of 100 hold the truth")
    assert (held / times > 0.84).all()
    assert (told.mean_sd > 0.9 * own * sigma).all()


def test_errors_of_copies_go_together(seed: int) -> None:
    """More colour, more bias and more scatter: so the rate of the axis is less certain than by each alone."""
    rng = np.random.default_rng(seed)
    found = copies(np.zeros(P), np.ones(P), 0.04)
    together = 0.04**2 * np.ones((2 * P, 2 * P))
    told = informed(record(rng, np.zeros(P), np.ones(P), 400), replace(found, error=together), rng)
    seen = np.corrcoef(np.hstack([told.off, np.log(told.power)]).T)
    assert (seen > 0.2).all()


def test_the_interval_of_the_mean_holds_the_truth(seed: int) -> None:
    """Of 90 %: what differs drawn from the prior, in 90 of 100, if nearly normal; two standard deviations off in 70."""
    rng = np.random.default_rng(seed)

    def held(truth: Floats) -> float:
        mean, sd = shrunk(truth + rng.standard_normal(len(truth)))
        return float(np.mean(np.abs(mean - truth) < 1.645 * sd))

    drawn = held(np.abs(rng.standard_cauchy(4000)) * rng.standard_normal(4000))
    worst = held(np.full(4000, 2.0))
    print(f"{100 * drawn:.0f} and {100 * worst:.0f} of 100 hold the truth")
    assert 0.87 < drawn < 0.93
    assert worst > 0.66
