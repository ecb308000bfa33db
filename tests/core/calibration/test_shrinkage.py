"""Records and their copies together: chance is taken for chance, and what the copies do not know for what it is."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.copy_excursions import Excursions
from monitor_core.calibration.healthy_statistics import EXPECTED_DIFFERENCES, draw_posterior, shrink
from monitor_core.calibration.scatter import Scatter
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
    # The mean is no part of what it may be off by.
    assert (abs(shrunk.off.mean(axis=0)) < 0.2 * shrunk.off.std(axis=0)).all()


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


# --- The posterior: several numbers seen with chance, of which most are nothing ---------------------------------------


def seen(e: Floats, rng: np.random.Generator, times: int = 1000) -> Floats:
    return draw_posterior(e, rng.standard_normal((times, len(e))), rng)


def scales(scale: float, n: int) -> tuple[Floats, Floats]:
    """Points and weights of a half Cauchy: Gauss and Legendre over its angle."""
    x, w = np.polynomial.legendre.leggauss(n)
    return scale * np.tan(np.pi / 4 * (1 + x)), w / 2


def moments(e: float, tau: Floats) -> Floats:
    """Likelihood of a single number, and with it the first and second moment, for each tau (3, T), over zeta."""
    zeta, weight = scales(1.0, 600)
    v = np.outer(tau, zeta) ** 2
    a = v / (1 + v)
    likelihood = np.exp(-(e**2) / (2 * (1 + v))) / np.sqrt(1 + v)
    return np.stack([(factor * likelihood) @ weight for factor in (np.ones_like(a), a * e, a + (a * e) ** 2)])


@pytest.mark.parametrize("e", [(0.0, 0.7), (-2.0, 0.3), (4.0, 3.0), (0.1, -5.0)])
def test_draws_are_of_the_posterior(e: tuple[float, float], seed: int) -> None:
    """Mean and standard deviation of two numbers, by quadrature over their scales and the one that they share."""
    tau, weight = scales(EXPECTED_DIFFERENCES / (2 - EXPECTED_DIFFERENCES), 600)
    each = [moments(number, tau) for number in e]
    draws = seen(np.array(e), np.random.default_rng(seed), 40_000)
    for i in range(2):
        total, mean, square = (each[i] * each[1 - i][0]) @ weight
        mean /= total
        sd = np.sqrt(square / total - mean**2)
        assert draws[:, i].mean() == pytest.approx(mean, abs=0.03)
        assert draws[:, i].std() == pytest.approx(sd, abs=0.03)


def test_what_is_far_out_is_left_alone(seed: int) -> None:
    e = np.array([-1e9, -30.0, 30.0, 1e6])
    draws = seen(e, np.random.default_rng(seed), 10_000)
    assert draws.mean(axis=0) == pytest.approx(e, abs=0.15)
    assert draws.std(axis=0) == pytest.approx(np.ones(4), abs=0.06)


def test_many_that_are_nothing_make_another_nothing(seed: int) -> None:
    """And one among others that are far out is not taken for chance."""
    rng = np.random.default_rng(seed)
    few, many = (np.abs(seen(np.full(n, 0.7), rng, 4000)).mean() for n in (2, 12))
    assert many < 0.7 * few
    nothing, something = (seen(np.array([2.0, *others]), rng, 4000)[:, 0].mean() for others in ([0] * 5, [6] * 5))
    assert something > nothing + 0.5


@pytest.mark.soak
def test_intervals_hold_the_truth(seed: int) -> None:
    """Of 90 %: in 90 of 100 of numbers that are drawn from the prior; of nothing in more, and narrow."""
    rng = np.random.default_rng(seed)
    n, times = 6, 250

    def held(truth: Floats) -> tuple[float, float]:
        lower, upper = np.quantile(seen(truth + rng.standard_normal(n), rng), [0.05, 0.95], axis=0)
        return float(((lower <= truth) & (truth <= upper)).mean()), float((upper - lower).mean()) / 3.29

    def from_prior() -> Floats:
        tau = abs(rng.standard_cauchy()) * EXPECTED_DIFFERENCES / (n - EXPECTED_DIFFERENCES)
        return np.asarray(tau * rng.standard_cauchy(n) * rng.standard_normal(n))

    drawn_held, _ = np.mean([held(from_prior()) for _ in range(times)], axis=0)
    nothing_held, width = np.mean([held(np.zeros(n)) for _ in range(times)], axis=0)
    print(f"{100 * drawn_held:.1f} and {100 * nothing_held:.1f} of 100; of nothing as wide as with sd {width:.2f}")
    assert 0.87 < drawn_held < 0.93
    assert nothing_held > 0.95
    assert width < 0.45


def test_chance_that_goes_together_stays_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    common = rng.standard_normal((4000, 1))
    draws = draw_posterior(np.full(4, 30.0), np.hstack([common, common, -common, rng.standard_normal((4000, 1))]), rng)
    together = np.asarray(np.corrcoef(draws.T))[0]
    assert together == pytest.approx([1, 1, -1, 0], abs=0.08)
