"""Innovations in another order keep their colour, and every copy has a record of its own."""

import numpy as np
import pytest
from scipy.signal import lfilter

from monitor_core.arrays import Floats
from monitor_core.calibration.innovation_bootstrap import MatchedBlocks, predicted_sum

N, COPIES, LENGTH, MANY = 60_000, 16, 100, 600


def coloured(rng: np.random.Generator, pole: float) -> Floats:
    return np.asarray(lfilter([1.0], [1, -pole], rng.standard_normal(N + 1000))[1000:])


def correlation(eps: Floats, lag: int) -> float:
    """Along the first axis."""
    return float((eps[lag:] * eps[:-lag]).mean() / (eps**2).mean())


def test_what_is_to_come_is_known_of_noise_of_one_pole(seed: int) -> None:
    """The sum of the next L is  a (1 - a^L) / (1 - a)  times the last one."""
    a, L = 0.9, 30
    eps = coloured(np.random.default_rng(seed), a)
    expected = a * (1 - a**L) / (1 - a) * eps
    assert np.std((predicted_sum(eps, L) - expected)[L:]) < 0.15 * np.std(expected)


def test_the_colour_stays_where_blocks_meet(seed: int) -> None:
    """Blocks that follow each other as they come would lose 30 and 60 of 100 of it."""
    rng = np.random.default_rng(seed)
    eps = coloured(rng, 0.97)
    drawn = MatchedBlocks(eps, LENGTH, MANY, COPIES, rng).take(N)
    kept = [correlation(drawn, lag) / correlation(eps, lag) for lag in (30, 60)]
    print(f"of the correlation at lags 30 and 60 are kept {kept}")
    assert kept == pytest.approx([1.0, 1.0], abs=0.15)


def test_they_are_as_large_as_those_of_the_record(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal(N) ** 3  # far out now and then
    drawn = MatchedBlocks(eps, LENGTH, MANY, COPIES, rng).take(N)
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
def test_short_records(samples: int) -> None:
    drawn = MatchedBlocks(np.arange(1.0, samples + 1), LENGTH, 8, 2, np.random.default_rng(1)).take(300)
    assert drawn.shape == (300, 2)
    assert set(np.unique(drawn)) <= set(range(1, samples + 1))
