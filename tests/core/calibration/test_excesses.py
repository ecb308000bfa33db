"""Large shocks have other sizes each time they are drawn: of the tail that all of them tell, each in its rank."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import genpareto

from monitor_core.arrays import Floats
from monitor_core.calibration.sieve_bootstrap import Shocks, pareto

N = 100_000


@pytest.mark.parametrize("xi", [-0.3, 0.0, 0.3, 0.9])
def test_the_distribution_is_the_one_they_are_of(xi: float, seed: int) -> None:
    excesses = genpareto.rvs(xi, scale=2.0, size=20_000, random_state=np.random.default_rng(seed))
    sigma, found = pareto(np.sort(excesses)[::-1])
    if xi > 0.45:  # it has no variance: no copy is to be made of one shock
        assert found == 0.45
    else:
        assert found == pytest.approx(xi, abs=0.06)  # their standard deviation is .01
        assert sigma == pytest.approx(2.0, rel=0.06)


def again(record: Floats, rng: np.random.Generator, times: int = 20) -> Floats:
    """Each shock of a record (N,), so many times (times, N)."""
    return Shocks(record).drawn(np.broadcast_to(np.arange(len(record)), (times, len(record))), rng)


def test_the_large_keep_their_ranks_and_the_others_their_sizes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = np.sort(rng.standard_normal(N))
    drawn, large = again(record, rng), N // 50
    np.testing.assert_array_equal(drawn[:, large:-large], np.tile(record[large:-large], (20, 1)))
    assert (np.diff(drawn[:, : large + 1]) >= 0).all()
    assert (np.diff(drawn[:, -large - 1 :]) >= 0).all()
    for side in (drawn[:, 0], drawn[:, -1]):
        assert len(set(side)) == 20


@pytest.mark.parametrize("skewed", [False, True])
def test_each_side_has_its_own_tail(skewed: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = rng.exponential(size=N) if skewed else rng.standard_normal(N)
    fresh = rng.exponential(size=20 * N) if skewed else rng.standard_normal(20 * N)
    share = [1e-4, 1e-3, 1 - 1e-3, 1 - 1e-4]
    np.testing.assert_allclose(
        np.quantile(again(record, rng), share), np.quantile(fresh, share), rtol=0.1, atol=0.01
    )


def looked_at(e: Floats) -> float:
    """By the hypothesis of four times the variance: the logarithm, 0, of the mean of exp(.375 e^2) / 2."""
    return float(np.log(np.mean(0.5 * np.exp(0.375 * e * e))))


def test_what_hangs_on_the_largest_is_told_by_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = [looked_at(again(rng.standard_normal(N), rng)) for _ in range(10)]
    print(f"off by {np.mean(drawn):+.3f} +- {np.std(drawn):.3f}")
    assert abs(np.mean(drawn)) < 0.06
    record = rng.standard_normal(N)
    larger = np.where(record == record.max(), 6.5, record)
    assert looked_at(larger) - looked_at(record) > 2.0
    unchanged, with_larger = (
        looked_at(again(values, np.random.default_rng(seed))) for values in (record, larger)
    )
    assert abs(with_larger - unchanged) < 0.1


@pytest.mark.parametrize("record", [np.arange(20_000.0), np.zeros(N), np.repeat([-1.0, 0.0, 1.0], N // 3)])
def test_few_shocks_and_such_of_one_size_stay_as_they_are(record: Floats, seed: int) -> None:
    drawn = again(record, np.random.default_rng(seed), 3)
    np.testing.assert_array_equal(drawn, np.tile(record, (3, 1)))
