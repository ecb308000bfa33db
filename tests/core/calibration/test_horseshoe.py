"""Several numbers seen with chance, of which most are nothing: what they may be."""

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.calibration.shrinkage import EXPECTED, draw_posterior


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

    tau, weight = scales(EXPECTED / (2 - EXPECTED), 600)
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
    nothing, something = (
        seen(np.array([2.0, *others]), rng, 4000)[:, 0].mean() for others in ([0] * 5, [6] * 5)
    )
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
        tau = abs(rng.standard_cauchy()) * EXPECTED / (n - EXPECTED)
        return np.asarray(tau * rng.standard_cauchy(n) * rng.standard_normal(n))

    drawn_held, _ = np.mean([held(from_prior()) for _ in range(times)], axis=0)
    nothing_held, width = np.mean([held(np.zeros(n)) for _ in range(times)], axis=0)
    print(
        f"{100 * drawn_held:.1f} and {100 * nothing_held:.1f} of 100; of nothing as wide as with sd {width:.2f}"
    )
    assert 0.87 < drawn_held < 0.93
    assert nothing_held > 0.95
    assert width < 0.45


def test_chance_that_goes_together_stays_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    common = rng.standard_normal((4000, 1))
    draws = draw_posterior(
        np.full(4, 30.0), np.hstack([common, common, -common, rng.standard_normal((4000, 1))]), rng
    )
    together = np.asarray(np.corrcoef(draws.T))[0]
    assert together == pytest.approx([1, 1, -1, 0], abs=0.08)
