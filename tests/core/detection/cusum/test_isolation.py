"""Likelihood ratios of single faults, against least squares done by brute force."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from monitor_core.arrays import Floats
from monitor_core.detection.isolation import limit, single_faults, sizes

P = 4
SCALE = np.array([1.0, 1e-2, 3e4, 1e-7])


def covariance(rng: np.random.Generator) -> Floats:
    """Of parameters of very different sizes, correlated."""
    root = rng.standard_normal((P, 2 * P))
    return np.asarray((root @ root.T) * np.outer(SCALE, SCALE))


def unexplained(d: Floats, V: Floats, changed: list[int]) -> float:
    """min over the sizes of (d - E delta)' V^-1 (d - E delta), by least squares on whitened numbers."""
    root = np.linalg.cholesky(V / np.outer(SCALE, SCALE))
    white = np.linalg.solve(root, d / SCALE)
    E = np.linalg.solve(root, np.eye(P)[:, changed])
    delta = np.linalg.lstsq(E, white, rcond=None)[0]
    return float(np.sum((white - E @ delta) ** 2))


@pytest.mark.parametrize("known", [[], [2], [0, 3]])
def test_ratios_are_those_of_least_squares(known: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    V, d = covariance(rng), 3 * SCALE * rng.standard_normal(P)
    causes = single_faults(d, V, known)
    gains = [unexplained(d, V, known) - unexplained(d, V, [*known, i]) for i in range(P) if i not in known]
    rest = [i for i in range(P) if i not in known]
    assert causes.T[rest] == pytest.approx(gains, rel=1e-4)
    assert causes.rest == pytest.approx(unexplained(d, V, [*known, causes.best]), rel=1e-4)
    assert (causes.T[known] == 0).all()
    assert causes.best == rest[int(np.argmax(gains))]
    weight = np.exp((np.array(gains) - max(gains)) / 2)
    assert causes.probability[rest] == pytest.approx(weight / weight.sum(), rel=1e-3)
    assert causes.freedom == P - 1 - len(known)


def test_sizes_are_the_likeliest_and_scatter_as_stated(seed: int) -> None:
    rng = np.random.default_rng(seed)
    V, true = covariance(rng), np.zeros(P)
    true[[1, 2]] = 5 * SCALE[[1, 2]]
    draws = rng.multivariate_normal(true / SCALE, V / np.outer(SCALE, SCALE), 4000) * SCALE
    found = np.array([sizes(d, V, [1, 2])[0] for d in draws])
    _, sd = sizes(draws[0], V, [1, 2])
    z = (found - true[[1, 2]]) / sd
    assert np.abs(z.mean(0)).max() < 5 / np.sqrt(4000)
    assert np.abs(z.std(0) - 1).max() < 5 / np.sqrt(2 * 4000)
    alone = single_faults(draws[0], V)
    size, size_sd = sizes(draws[0], V, [1])
    assert (alone.size[1], alone.size_sd[1]) == (pytest.approx(size[0]), pytest.approx(size_sd[0]))


def test_without_a_change_each_ratio_is_chi_square(seed: int) -> None:
    rng = np.random.default_rng(seed)
    V = covariance(rng)
    draws = rng.multivariate_normal(np.zeros(P), V / np.outer(SCALE, SCALE), 2000) * SCALE
    T = np.array([single_faults(d, V).T for d in draws])
    assert min(kstest(T[:, i], chi2(1).cdf).pvalue for i in range(P)) > 1e-6


def test_what_cannot_be_told_apart_is_equally_likely() -> None:
    V = np.array([[1.0, 1.0], [1.0, 1.0]])
    causes = single_faults(np.array([5.0, 5.0]), V)
    assert causes.probability == pytest.approx([0.5, 0.5], abs=0.01)
    assert np.isfinite(causes.size_sd).all()


def test_a_single_parameter_is_the_cause_and_explains_all() -> None:
    causes = single_faults(np.array([5.0]), np.array([[1.0]]))
    assert (causes.T[0], causes.size[0], causes.probability[0]) == (
        pytest.approx(25.0),
        pytest.approx(5.0),
        1.0,
    )
    assert causes.explains(4.0)
    nothing_left = single_faults(np.array([5.0]), np.array([[1.0]]), [0])
    assert not nothing_left.stands_out(4.0)


@pytest.mark.parametrize("freedom", [1, 2, 5])
def test_limits_are_passed_as_seldom_as_the_tolerance(freedom: int) -> None:
    assert chi2.sf(limit(4.0, freedom), freedom) == pytest.approx(chi2.sf(16.0, 1))
    assert limit(0.0, freedom) > 10
    assert limit(50.0, freedom) == np.inf
    assert limit(4.0, 0) == np.inf
