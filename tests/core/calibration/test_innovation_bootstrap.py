"""Innovations that never were: of the record's colour and spread, and with bursts that the record did not have."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter
from scipy.stats import genpareto

from monitor_core.arrays import Floats
from monitor_core.calibration.innovation_bootstrap import (
    MatchedBlocks,
    Shocks,
    SieveBootstrap,
    pareto,
    predicted_sum,
    whitening_filter,
)

N, COPIES = 40_000, 16


def coloured(rng: np.random.Generator, pole: float, number: int = N, uniform: bool = False) -> Floats:
    noise = rng.uniform(-1, 1, number) if uniform else rng.standard_normal(number)
    eps = lfilter([1.0], [1, -pole], noise)
    return np.asarray(eps - eps.mean())


def autocorrelation(eps: Floats, lag: int) -> float:
    return float((eps[:-lag] * eps[lag:]).mean() / (eps * eps).mean())


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
def test_the_filter_is_the_one_that_coloured_it(pole: float, seed: int) -> None:
    a = whitening_filter(coloured(np.random.default_rng(seed), pole))
    np.testing.assert_allclose(a[:2], [1.0, -pole][: len(a)], atol=0.04)
    np.testing.assert_allclose(a[2:], 0.0, atol=0.04)


def test_a_filter_of_two_poles(seed: int) -> None:
    true = [1.0, -1.6, 0.8]
    eps = lfilter([1.0], true, np.random.default_rng(seed).standard_normal(N))
    a = whitening_filter(eps - eps.mean())
    np.testing.assert_allclose(a[:3], true, atol=0.05)


def test_a_filter_of_no_order(seed: int) -> None:
    """With a zero next to the circle, as of innovations of an axis: their power is told also where it is small."""
    rng, w, off = np.random.default_rng(seed), np.linspace(0, np.pi / 4, 64), []
    true = np.abs(freqz([1, -0.95], worN=w)[1]) ** 2
    for _ in range(20):
        eps = lfilter([1, -0.95], [1.0], rng.standard_normal(N))
        a = whitening_filter(eps)
        off.append(np.log(np.var(lfilter(a, [1.0], eps)) / np.abs(freqz(a, worN=w)[1]) ** 2 / true))
    at_zero, rms = np.mean(off, axis=0)[0], np.sqrt(np.mean(np.square(off)))
    print(f"the logarithm of the power is off by {rms:.3f}, at zero in the mean by {at_zero:+.3f}")
    assert rms < 0.13  # with the order of the least BIC .18
    assert abs(at_zero) < 0.11  # with that of the least AIC .2


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_colour_and_spread_are_the_records(pole: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = coloured(rng, pole)
    drawn = SieveBootstrap(eps, COPIES, rng).take(N)
    assert drawn.shape == (N, COPIES)
    assert drawn.std() == pytest.approx(eps.std(), rel=0.05)
    assert abs(drawn.mean()) < 0.1 * eps.std()
    for lag in (1, 5, 20):
        found = np.mean([autocorrelation(drawn[:, a], lag) for a in range(COPIES)])
        assert found == pytest.approx(autocorrelation(eps, lag), abs=0.06)


def test_it_goes_on_where_it_was(seed: int) -> None:
    """Whatever the pieces: no step where they meet, the first samples as the others, and each copy of its own."""
    rng = np.random.default_rng(seed)
    eps = coloured(rng, 0.95, uniform=True)
    sieve = SieveBootstrap(eps, COPIES, rng)
    drawn = np.concatenate([sieve.take(count) for count in [1, 7, 10, 333] * 30])
    shocks = drawn[1:] - 0.95 * drawn[:-1]
    assert abs(shocks).max() < 1.3  # of 1, but for what the filter is off by
    first = np.array([SieveBootstrap(eps, COPIES, np.random.default_rng(seed + k)).take(1) for k in range(60)])
    assert first.std() == pytest.approx(eps.std(), rel=0.25)
    assert abs(np.corrcoef(drawn.T) - np.eye(COPIES)).max() < 0.35


def test_bursts_are_larger_than_the_records(seed: int) -> None:
    """The power of half a memory, the largest of many copies: as of so many fresh records, not as of this one."""
    rng, many, found = np.random.default_rng(seed), 32, []

    def largest(eps: Floats) -> float:
        return float((eps.reshape(-1, 20) ** 2).mean(axis=1).max())

    for _ in range(8):
        record = coloured(rng, 0.5, 4000)
        drawn = SieveBootstrap(record, many, rng).take(N).T.reshape(-1)
        found.append([largest(drawn), largest(record), largest(coloured(rng, 0.5, many * N))])
    of_copies, of_the_record, of_fresh = np.exp(np.mean(np.log(found), axis=0))
    assert of_copies > 1.25 * of_the_record
    assert of_copies == pytest.approx(of_fresh, rel=0.3)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_each_knows_which_sample_it_is_drawn_from(pole: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = coloured(rng, pole)
    a, sieve = whitening_filter(eps), SieveBootstrap(eps, 3, rng)
    taken = [(sieve.take(count), sieve.origin) for count in (7, 2500, 1, 90)]
    drawn, origin = (np.concatenate(parts) for parts in zip(*taken, strict=True))
    shocks, own = lfilter(a, [1.0], drawn, axis=0), lfilter(a, [1.0], eps)
    own -= own[len(a) - 1 :].mean()
    shocks, source = shocks[len(a) :], own[origin[len(a) :]]
    low, high = np.quantile(own[len(a) - 1 :], [0.03, 0.97])
    middle = (source > low) & (source < high)  # the largest have other sizes each time
    assert middle.mean() > 0.9
    np.testing.assert_allclose(shocks[middle], source[middle], atol=1e-9)
    assert (shocks[source < low] < low).all()
    assert (shocks[source > high] > high).all()


def test_a_short_record_is_drawn_as_it_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = np.array([1.0, -1.0, 2.0, -2.0])
    drawn = SieveBootstrap(eps, 3, rng).take(50)
    assert drawn.shape == (50, 3)
    assert set(np.unique(drawn)) <= set(eps)


# --- Large shocks have other sizes each time they are drawn: of the tail that all of them tell, each in its rank ------


SHOCKS = 100_000


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
    """Each shock of a record (SHOCKS,), so many times (times, SHOCKS)."""
    return Shocks(record).drawn(np.broadcast_to(np.arange(len(record)), (times, len(record))), rng)


def test_the_large_keep_their_ranks_and_the_others_their_sizes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = np.sort(rng.standard_normal(SHOCKS))
    drawn, large = again(record, rng), SHOCKS // 50
    np.testing.assert_array_equal(drawn[:, large:-large], np.tile(record[large:-large], (20, 1)))
    assert (np.diff(drawn[:, : large + 1]) >= 0).all()
    assert (np.diff(drawn[:, -large - 1 :]) >= 0).all()
    for side in (drawn[:, 0], drawn[:, -1]):
        assert len(set(side)) == 20


@pytest.mark.parametrize("skewed", [False, True])
def test_each_side_has_its_own_tail(skewed: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    record = rng.exponential(size=SHOCKS) if skewed else rng.standard_normal(SHOCKS)
    fresh = rng.exponential(size=20 * SHOCKS) if skewed else rng.standard_normal(20 * SHOCKS)
    share = [1e-4, 1e-3, 1 - 1e-3, 1 - 1e-4]
    np.testing.assert_allclose(np.quantile(again(record, rng), share), np.quantile(fresh, share), rtol=0.1, atol=0.01)


def looked_at(e: Floats) -> float:
    """By the hypothesis of four times the variance: the logarithm, 0, of the mean of exp(.375 e^2) / 2."""
    return float(np.log(np.mean(0.5 * np.exp(0.375 * e * e))))


def test_what_hangs_on_the_largest_is_told_by_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = [looked_at(again(rng.standard_normal(SHOCKS), rng)) for _ in range(10)]
    print(f"off by {np.mean(drawn):+.3f} +- {np.std(drawn):.3f}")
    assert abs(np.mean(drawn)) < 0.06
    record = rng.standard_normal(SHOCKS)
    larger = np.where(record == record.max(), 6.5, record)
    assert looked_at(larger) - looked_at(record) > 2.0
    unchanged, with_larger = (looked_at(again(values, np.random.default_rng(seed))) for values in (record, larger))
    assert abs(with_larger - unchanged) < 0.1


@pytest.mark.parametrize("record", [np.arange(20_000.0), np.zeros(SHOCKS), np.repeat([-1.0, 0.0, 1.0], SHOCKS // 3)])
def test_few_shocks_and_such_of_one_size_stay_as_they_are(record: Floats, seed: int) -> None:
    drawn = again(record, np.random.default_rng(seed), 3)
    np.testing.assert_array_equal(drawn, np.tile(record, (3, 1)))


# --- Innovations in another order keep their colour, and every copy has a record of its own ---------------------------


LONG, LENGTH, MANY = 60_000, 100, 600


def test_what_is_to_come_is_known_of_noise_of_one_pole(seed: int) -> None:
    """The sum of the next L is  a (1 - a^L) / (1 - a)  times the last one."""
    a, L = 0.9, 30
    eps = coloured(np.random.default_rng(seed), a, LONG)
    expected = a * (1 - a**L) / (1 - a) * eps
    assert np.std((predicted_sum(eps, L) - expected)[L:]) < 0.15 * np.std(expected)


def test_the_colour_stays_where_blocks_meet(seed: int) -> None:
    """Blocks that follow each other as they come would lose 30 and 60 of 100 of it."""
    rng = np.random.default_rng(seed)
    eps = coloured(rng, 0.97, LONG)
    drawn = MatchedBlocks(eps, LENGTH, MANY, COPIES, rng).take(LONG)
    kept = [autocorrelation(drawn, lag) / autocorrelation(eps, lag) for lag in (30, 60)]
    print(f"of the correlation at lags 30 and 60 are kept {kept}")
    assert kept == pytest.approx([1.0, 1.0], abs=0.15)


def test_they_are_as_large_as_those_of_the_record(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal(LONG) ** 3  # far out now and then
    drawn = MatchedBlocks(eps, LENGTH, MANY, COPIES, rng).take(LONG)
    assert drawn.std() == pytest.approx(eps.std(), rel=0.1)
    assert abs(drawn.mean() - eps.mean()) < 0.05 * eps.std()
    assert set(np.unique(drawn)) <= set(eps)


def test_every_copy_has_blocks_of_its_own(seed: int) -> None:
    """As many as there is room for in the record, drawn with replacement: 63 of 100 samples; all copies have all."""
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal(6000)
    blocks = MatchedBlocks(eps, LENGTH, 60, COPIES, rng)
    first, drawn = blocks.take(30_000), blocks.take(30_000)
    for copy in range(COPIES):
        seen = np.unique(drawn[:, copy])
        assert 0.4 < len(seen) / len(eps) < 0.8
        assert len(np.intersect1d(seen, first[:, copy])) > 0.85 * len(seen)  # the same again
    assert len(np.unique(drawn)) > 0.95 * len(eps)


def test_any_number_is_taken_at_once_or_in_pieces() -> None:
    eps = np.random.default_rng(1).standard_normal(500)
    at_once = MatchedBlocks(eps, 40, 20, 3, np.random.default_rng(2)).take(300)
    pieces = MatchedBlocks(eps, 40, 20, 3, np.random.default_rng(2))
    assert np.array_equal(at_once, np.concatenate([pieces.take(k) for k in (1, 99, 200)]))


@pytest.mark.parametrize("samples", [2, 3, 50])
def test_short_records_are_drawn_in_blocks(samples: int) -> None:
    drawn = MatchedBlocks(np.arange(1.0, samples + 1), LENGTH, 8, 2, np.random.default_rng(1)).take(300)
    assert drawn.shape == (300, 2)
    assert set(np.unique(drawn)) <= set(range(1, samples + 1))
