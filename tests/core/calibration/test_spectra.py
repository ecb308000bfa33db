"""How steeply g falls, and how well a record knows that: for exact models 1, and as many records scatter."""

import numpy as np
import pytest
from scipy.signal import lfilter

from monitor_core.arrays import Floats
from monitor_core.calibration.spectra import Spectra
from tests.shares import soaked

N, LENGTH, RECORDS = 10_000, 100, 120


def of_variances(*factors: float) -> Spectra:
    """Hypotheses that say that the innovations, of variance 1, have so many times that."""
    return Spectra(np.array([1.0, *factors]), np.zeros(len(factors)), LENGTH)


def differences(rng: np.random.Generator) -> Floats:
    """What three hypotheses look at (N, 3): all frequencies; low ones; a step of no end."""
    white = rng.standard_normal(N)
    low = lfilter([1.0], [1, -0.98], white)
    return np.stack([rng.standard_normal(N), low, np.ones(N)], axis=1)


@pytest.mark.parametrize("colour", soaked([0.0, 0.8], 0.8), ids=["white", "coloured"])
def test_the_covariance_is_that_of_many_records(colour: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wave, stated = differences(rng), []
    found = np.empty((RECORDS, 3))
    window = np.hanning(LENGTH + 2)[1:-1, np.newaxis]
    looked_at = np.zeros((LENGTH // 2 + 1, 3))
    for part in wave.reshape(-1, LENGTH, 3):
        looked_at += np.abs(np.fft.rfft(part * window, axis=0)) ** 2
    fine, coarse = np.fft.rfftfreq(N), np.fft.rfftfreq(LENGTH)
    weight = np.stack([np.interp(fine, coarse, power) for power in looked_at.T], axis=1)
    for k in range(RECORDS):
        eps = lfilter([1.0], [1, -colour], rng.standard_normal(N))
        spectra = of_variances(1.0, 1.0, 1.0)
        spectra.add([np.column_stack([eps, eps[:, np.newaxis] + wave])])
        stated.append(spectra.covariance())
        found[k] = np.log(np.abs(np.fft.rfft(eps)) ** 2 @ weight)  # of the whole record at once
    mean = np.mean(stated, axis=0)
    print(np.sqrt(np.diag(mean)), found.std(axis=0))
    np.testing.assert_allclose(np.sqrt(np.diag(mean)), found.std(axis=0), rtol=0.2)
    assert mean[0, 0] < mean[1, 1] < mean[2, 2]
    # Hann's window sees what has no end in half a band, and a quarter of it in the next: (2/3)^2 / (1/2) + (1/3)^2 = 1.
    assert mean[2, 2] * N / LENGTH == pytest.approx(1.0, rel=0.15)
    np.testing.assert_allclose(mean, mean.T)
    assert np.linalg.eigvalsh(mean).min() > -1e-12


def alternatives(eps: Floats, moved: Floats) -> Floats:
    """Innovations (N, 1 + 4): as they are, twice; filtered; that and moved; moved alone."""
    filtered = lfilter([1.0, -0.2, 0.1], [1.0, 0.1], eps)
    return np.stack([eps, eps, filtered, filtered + moved, eps + moved], axis=1)


FACTORS = (1.5, 1.2, 1.0, 1.3)
_TAPERED = np.sqrt(35 / 18)
"""By what segments with Hann's window w know the power less well than the record:  N sum(w^4) / sum(w^2)^2."""


def test_of_an_exact_model_g_falls_with_one(seed: int) -> None:
    """White noise of the variance that is said: the mean of exp(l) is 1, whatever a hypothesis filters and says."""
    rng = np.random.default_rng(seed)
    spectra, eps = of_variances(*FACTORS), rng.standard_normal(20 * N)
    spectra.add([alternatives(eps, lfilter([0.3], [1, -0.9], rng.standard_normal(20 * N)))])
    print(spectra.r())
    np.testing.assert_allclose(spectra.r(), 1.0, atol=0.06)
    # With the r of a difference alone twice the power is half of it.
    twice = of_variances(1.0)
    twice.add([np.stack([np.sqrt(2) * eps, np.sqrt(2) * eps + 0.3 * rng.standard_normal(20 * N)], axis=1)])
    np.testing.assert_allclose(twice.r(), 0.5, atol=0.03)


def test_of_a_short_record_chance_is_not_taken_for_a_filter(seed: int) -> None:
    """What moves a hypothesis three times as far as noise goes along with that by chance, and is no less known."""
    few, stated = 20 * LENGTH, []
    for rng in np.random.default_rng(seed).spawn(40):
        eps, moved = rng.standard_normal((2, few)) * [[1.0], [3.0]]
        spectra = of_variances(1.0)
        spectra.add([np.column_stack([eps, eps + moved])])
        stated.append(float(np.sqrt(spectra.covariance()[0, 0])))
    print(f"log r known within {np.median(stated):.3f}, of ordinates of all frequencies {np.sqrt(2 / few):.3f}")
    assert 0.8 * np.sqrt(2 / few) < np.median(stated) < 3 * np.sqrt(2 / few)


def test_what_is_taken_from_a_ratio_makes_g_fall_faster(seed: int) -> None:
    """Ratios of a move d are -d^2 / 2 in the mean; less as much again, they are twice as far below zero."""
    eps, d = np.random.default_rng(seed).standard_normal((2, 20 * N)) * [[1.0], [0.5]]
    spectra = Spectra(np.ones(2), np.array([np.mean(d * d) / 2]), LENGTH)
    spectra.add([np.column_stack([eps, eps + d])])
    np.testing.assert_allclose(spectra.r(), 2.0, rtol=0.04)


@pytest.mark.parametrize("colour", soaked([0.0, -0.3], -0.3), ids=["white", "coloured"])
def test_the_covariance_of_log_r_is_that_of_many_records(colour: float, seed: int) -> None:
    """Also where a hypothesis says other things of the noise: then a little more power makes g fall much less."""
    rng = np.random.default_rng(seed)
    moved, found, stated = lfilter([0.3], [1, -0.9], rng.standard_normal(N)), [], []
    for _ in range(RECORDS):
        eps = np.sqrt(1 - colour**2) * lfilter([1.0], [1, -colour], rng.standard_normal(N))
        spectra = of_variances(*FACTORS)
        spectra.add([alternatives(eps, moved)])
        found.append(np.log(spectra.r()))
        stated.append(spectra.covariance())
    mean = np.mean(stated, axis=0)
    own, stated_sd = np.std(found, axis=0) / _TAPERED, np.sqrt(np.diag(mean))
    print(np.exp(np.mean(found, axis=0)), own, stated_sd)
    np.testing.assert_allclose(stated_sd, own, rtol=0.4)
    # More power alone, with nothing but noise: five times what it is off by.
    assert stated_sd[0] > 3 * np.sqrt(2 / N)
    np.testing.assert_allclose(mean / np.outer(stated_sd, stated_sd), np.corrcoef(np.transpose(found)), atol=0.25)


def test_records_add_up_and_gaps_are_left_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal((5 * N, 3)) * [1.0, 0.5, 0.5]
    eps[:, 1:] += eps[:, :1]
    once, twice, broken = (of_variances(1.0, 1.0) for _ in range(3))
    with_gap = np.concatenate([eps, np.full((50, 3), np.nan)])
    with_gap[-20:, 0] = 1.0
    for spectra, added in ((once, [eps]), (twice, [eps, eps]), (broken, [with_gap, eps])):
        for rows in added:
            spectra.add([rows])
    np.testing.assert_allclose(broken.covariance(), twice.covariance())
    np.testing.assert_allclose(twice.covariance(), once.covariance() / 2, rtol=0.05)


def test_a_record_is_the_same_in_blocks(seed: int) -> None:
    """Blocks of other lengths than the segments, some of them empty."""
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal((N, 3))
    eps[rng.integers(0, N, 50)] = np.nan
    at_once, in_blocks = of_variances(1.0, 1.2), of_variances(1.0, 1.2)
    for rows in (eps, eps[: N // 2]):
        at_once.add([rows])
        in_blocks.add(np.split(rows, sorted([*rng.integers(0, len(rows), 60).tolist(), 0])))
    np.testing.assert_array_equal(in_blocks.covariance(), at_once.covariance())
    np.testing.assert_array_equal(in_blocks.r(), at_once.r())


def test_nothing_is_known_of_what_nothing_speaks_for(seed: int) -> None:
    eps = np.random.default_rng(seed).standard_normal((N, 1))
    spectra = of_variances(1.0, 1.0, 1.0)
    spectra.add([np.column_stack([eps, eps, 2 * eps, eps + 0.5])])
    covariance = spectra.covariance()
    assert not covariance[0].any()
    assert covariance[1, 1] < 1e-4
    assert covariance[2, 2] > 0
    assert not of_variances(1.0, 1.0).covariance().any()


def test_of_a_short_record_no_more_is_said_than_holds(seed: int) -> None:
    """One segment tells an offset from two ordinates, the first of half a band: log r to sqrt(2/3) at the very best."""
    eps = np.random.default_rng(seed).standard_normal(LENGTH)
    spectra = of_variances(1.0)
    spectra.add([np.column_stack([eps, eps + 0.5])])
    assert np.sqrt(spectra.covariance()[0, 0]) == pytest.approx(0.5)
