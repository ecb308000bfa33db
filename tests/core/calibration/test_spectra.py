"""How well a record knows the power of its innovations: against the scatter of that power over many records."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from monitor_core.calibration.spectra import Spectra
from monitor_core.kernel.tables import Floats

N, LENGTH, RECORDS = 20_000, 100, 600


def differences(rng: np.random.Generator) -> Floats:
    """What three hypotheses look at (N, 3): all frequencies; low ones; a step of no end."""
    white = rng.standard_normal(N)
    low = lfilter([1.0], [1, -0.98], white)
    return np.stack([rng.standard_normal(N), low, np.ones(N)], axis=1)


@pytest.mark.parametrize("colour", [0.0, 0.8], ids=["white", "coloured"])
def test_the_covariance_is_that_of_many_records(colour: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wave, stated = differences(rng), []
    found = np.empty((RECORDS, 3))
    window = np.hanning(LENGTH + 2)[1:-1, np.newaxis]
    looked_at = np.zeros((LENGTH // 2 + 1, 3))
    for one in wave.reshape(-1, LENGTH, 3):
        looked_at += np.abs(np.fft.rfft(one * window, axis=0)) ** 2
    fine, coarse = np.fft.rfftfreq(N), np.fft.rfftfreq(LENGTH)
    weight = np.stack([np.interp(fine, coarse, one) for one in looked_at.T], axis=1)
    for k in range(RECORDS):
        eps = lfilter([1.0], [1, -colour], rng.standard_normal(N))
        spectra = Spectra(3, LENGTH)
        spectra.add(np.column_stack([eps, eps[:, np.newaxis] + wave]))
        stated.append(spectra.covariance())
        found[k] = np.log(np.abs(np.fft.rfft(eps)) ** 2 @ weight)  # of the whole record at once
    mean = np.mean(stated, axis=0)
    print(np.sqrt(np.diag(mean)), found.std(axis=0))
    np.testing.assert_allclose(np.sqrt(np.diag(mean)), found.std(axis=0), rtol=0.2)
    assert mean[0, 0] < mean[1, 1] < mean[2, 2]
    np.testing.assert_allclose(mean, mean.T)
    assert np.linalg.eigvalsh(mean).min() > -1e-12


def test_records_add_up_and_gaps_are_left_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    eps = rng.standard_normal((N, 3))
    once, twice = Spectra(2, LENGTH), Spectra(2, LENGTH)
    once.add(eps)
    twice.add(eps)
    with_gap = np.concatenate([eps, np.full((50, 3), np.nan)])
    with_gap[-20:, 0] = 1.0
    twice.add(with_gap)
    np.testing.assert_allclose(twice.covariance(), once.covariance() / 2)


def test_nothing_is_known_of_what_never_differs(seed: int) -> None:
    eps = np.random.default_rng(seed).standard_normal((N, 1))
    spectra = Spectra(2, LENGTH)
    spectra.add(np.column_stack([eps, eps, 2 * eps]))
    covariance = spectra.covariance()
    assert covariance[0].tolist() == [0.0, 0.0]
    assert covariance[1, 1] > 0
    assert Spectra(2, LENGTH).covariance().tolist() == [[0.0, 0.0], [0.0, 0.0]]
