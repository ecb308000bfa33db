"""Likelihood ratios of single faults, against least squares done by brute force."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from monitor_core.arrays import Floats
from monitor_core.detection.isolation import MAX_SHARE, SECOND_DIRECTION, Payload, limit, single_faults, sizes

P = 4
SCALE = np.array([1.0, 1e-2, 3e4, 1e-7])


def covariance(rng: np.random.Generator) -> Floats:
    """Of parameters of very different sizes, correlated."""
    root = rng.standard_normal((P, 2 * P))
    return np.asarray((root @ root.T) * np.outer(SCALE, SCALE))


def unexplained(d: Floats, V: Floats, changed: list[int], *directions: Floats) -> float:
    """min over the sizes of (d - E delta)' V^-1 (d - E delta), by least squares on whitened numbers."""
    root = np.linalg.cholesky(V / np.outer(SCALE, SCALE))
    white = np.linalg.solve(root, d / SCALE)
    along = np.array(directions).reshape(-1, P).T / SCALE[:, np.newaxis]
    E = np.linalg.solve(root, np.hstack([np.eye(P)[:, changed], along]))
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


KT, LOAD = 0, 3
NOMINAL = np.array([1.0, 0.02, 5e4, 1e-6])
"""Of kT, two frictions and the load (in an odd unit)"""
PAYLOAD = Payload(LOAD, -NOMINAL)


def after_payload(inertia: float, weight: float) -> Floats:
    """Deviations with so many times the inertia and the weight: all torques are over a larger inertia."""
    theta = NOMINAL / inertia
    theta[LOAD] *= weight
    return np.asarray(theta - NOMINAL)


@pytest.mark.parametrize(("inertia", "weight"), [(1.5, 1.4), (1.2, 1.5), (0.8, 0.7)])
def test_a_payload_that_changes_the_inertia_is_a_change_of_the_load(inertia: float, weight: float) -> None:
    d, V = after_payload(inertia, weight), np.diag((0.02 * NOMINAL) ** 2)
    causes = single_faults(d, V, payload=PAYLOAD)
    assert causes.best == LOAD
    assert causes.explains(4.0)
    assert causes.payload == pytest.approx(float(d @ np.linalg.solve(V, d)), rel=1e-6)
    assert causes.T[LOAD] == pytest.approx(causes.payload - SECOND_DIRECTION)
    size, size_sd = sizes(d, V, [LOAD], PAYLOAD)
    assert causes.size[LOAD] / NOMINAL[LOAD] == pytest.approx(weight - 1, abs=1e-6)
    assert (size[0], size_sd[0]) == (pytest.approx(causes.size[LOAD]), pytest.approx(causes.size_sd[LOAD]))
    without = single_faults(d, V)
    assert not without.explains(4.0)


def test_the_weight_of_a_payload_scatters_as_stated(seed: int) -> None:
    """Most of it comes from the inertia here."""
    V = np.diag((np.array([0.05, 0.05, 0.05, 0.005]) * NOMINAL) ** 2)
    draws = np.random.default_rng(seed).multivariate_normal(after_payload(1.5, 1.4) / SCALE, V / SCALE**2, 4000)
    found, sd = np.array([[x[0] for x in sizes(d * SCALE, V, [LOAD], PAYLOAD)] for d in draws]).T
    z = (found / NOMINAL[LOAD] - 0.4) / (sd / NOMINAL[LOAD])
    assert abs(z.mean()) < 0.15
    assert abs(z.std() - 1) < 0.1


def test_a_payload_is_preferred_only_if_it_explains_much_more() -> None:
    """It has a direction more; and what is a single parameter stays one."""
    V = np.diag((0.02 * NOMINAL) ** 2)
    weaker = np.array([-0.2, 0.0, 0.0, 0.0]) * NOMINAL
    causes = single_faults(weaker, V, payload=PAYLOAD)
    assert causes.best == KT
    assert not causes.is_like_payload(KT)
    heavier = np.array([0.0, 0.0, 0.0, 0.2]) * NOMINAL
    assert single_faults(heavier, V, payload=PAYLOAD).T[LOAD] == pytest.approx(100.0, rel=1e-4)
    hardly = after_payload(1.02, 1.25)
    causes = single_faults(hardly, V, payload=PAYLOAD)
    assert causes.payload > causes.T[LOAD] == pytest.approx(single_faults(hardly, V).T[LOAD])


def test_where_friction_is_hardly_known_a_weaker_motor_looks_like_a_payload() -> None:
    V = np.diag((np.array([0.02, 2.0, 2.0, 0.02]) * NOMINAL) ** 2)
    causes = single_faults(np.array([-0.2, 0.0, 0.0, 0.0]) * NOMINAL, V, payload=PAYLOAD)
    assert causes.best == KT
    assert causes.is_like_payload(KT)
    both = after_payload(1.3, 1.2)
    known = single_faults(both, V, payload=PAYLOAD._replace(cost=0.0))
    assert known.T[LOAD] == known.payload
    assert known.best == LOAD


def test_no_payload_adds_inertia_and_takes_weight() -> None:
    """Nor does it add far more inertia than weight."""
    V = np.diag((0.02 * NOMINAL) ** 2)
    for inertia, weight in ((1.5, 0.6), (0.7, 1.4), (1.5, 1 + 0.4 / MAX_SHARE)):
        causes = single_faults(after_payload(inertia, weight), V, payload=PAYLOAD)
        assert causes.payload == 0
        assert not any(causes.is_like_payload(i) for i in range(P))


def test_given_a_payload_nothing_else_has_changed(seed: int) -> None:
    """What the larger inertia explains is no evidence for another parameter; what it does not explain is."""
    rng = np.random.default_rng(seed)
    V = covariance(rng) * 1e-5
    d = after_payload(1.5, 1.4)
    assert single_faults(d, V, [LOAD]).T.max() > 100
    causes = single_faults(d, V, [LOAD], payload=PAYLOAD)
    assert causes.T.max() == pytest.approx(0, abs=1e-3)
    d[1] += 50 * np.sqrt(V[1, 1])  # so far that no payload explains it, and that the best one has possible values
    causes = single_faults(d, V, [LOAD], payload=PAYLOAD)
    gain = unexplained(d, V, [LOAD], PAYLOAD.inertia) - unexplained(d, V, [LOAD, 1], PAYLOAD.inertia)
    assert causes.T[1] == pytest.approx(gain, rel=1e-3)
    assert causes.T[1] > 100


def test_given_a_payload_the_scatter_of_its_weight_is_no_other_change(seed: int) -> None:
    """With the weight that the estimates show, many of these draws have far more inertia than any payload adds."""
    known = PAYLOAD._replace(cost=0.0)
    V = np.diag((np.array([0.02, 0.05, 0.05, 0.07]) * NOMINAL) ** 2)
    draws = np.random.default_rng(seed).multivariate_normal(after_payload(1.25, 1.1) / SCALE, V / SCALE**2, 2000)
    given = [single_faults(d * SCALE, V, [LOAD], payload=known) for d in draws]
    assert sum(causes.payload == 0 for causes in given) < 10
    # Of the payloads inside the limits, 0.1 % are beyond the tolerance; that 10 are has a probability below 1e-4.
    assert sum(causes.stands_out(4.0) for causes in given) < 10
    for inertia, weight in ((1.5, 0.6), (0.7, 1.4)):  # far beyond the tolerance
        causes = single_faults(after_payload(inertia, weight), V / 25, [LOAD], payload=known)
        assert causes.payload == 0
        assert causes.best == KT
        assert causes.stands_out(4.0)


UNWEIGHED = Payload(KT, -NOMINAL * (1, 1, 1, 0), weighed=False)
"""The same where no load is monitored; the last parameter is no torque."""


@pytest.mark.parametrize("weight", [1.4, 0.6])
def test_where_no_weight_is_monitored_a_payload_lowers_all_torques_alike(weight: float, seed: int) -> None:
    """It counts as a change of kT, which explains all of it, and by the same share."""
    V = np.diag((0.02 * NOMINAL) ** 2)
    d = NOMINAL * (1, 1, 1, 0) * (1 / weight - 1)
    causes = single_faults(d, V, payload=UNWEIGHED)
    assert (causes.best, causes.in_proportion) == (KT, True)
    assert causes.explains(4.0)
    assert causes.freedom == P - 1
    assert causes.T[KT] == pytest.approx(float(d @ np.linalg.solve(V, d)) - SECOND_DIRECTION, rel=1e-6)
    assert not single_faults(d, V).explains(4.0)
    size, size_sd = sizes(d, V, [KT], UNWEIGHED)
    assert causes.size[KT] == pytest.approx(d[KT])
    assert (size[0], size_sd[0]) == (pytest.approx(causes.size[KT]), pytest.approx(causes.size_sd[KT]))
    draws = np.random.default_rng(seed).multivariate_normal(d / SCALE, V / SCALE**2, 2000)
    z = np.array([(sizes(x * SCALE, V, [KT], UNWEIGHED)[0][0] - d[KT]) / size_sd[0] for x in draws])
    assert abs(z.std() - 1) < 5 / np.sqrt(2 * len(z))


def test_what_is_no_payload_stays_what_it_is_where_no_weight_is_monitored() -> None:
    V = np.diag((0.02 * NOMINAL) ** 2)
    for changed in range(P):
        d = np.where(np.arange(P) == changed, -0.3 * NOMINAL, 0.0)
        causes = single_faults(d, V, payload=UNWEIGHED)
        assert (causes.best, causes.in_proportion) == (changed, False)
        assert causes.T[changed] == pytest.approx(225.0, rel=1e-6)
        assert causes.explains(4.0)
    weaker = np.array([-0.3, 0.0, 0.0, 0.0]) * NOMINAL
    assert sizes(weaker, V, [KT], UNWEIGHED)[0] == pytest.approx(-0.3, rel=1e-6)
    opposite = np.array([-0.3, 0.3, 0.3, 0.0]) * NOMINAL
    assert not single_faults(opposite, V, payload=UNWEIGHED).explains(4.0)
    beside = np.array([-0.3, -0.3, -0.3, 0.3]) * NOMINAL
    causes = single_faults(beside, V, payload=UNWEIGHED)
    assert causes.in_proportion
    assert not causes.explains(4.0)
    assert pytest.approx(single_faults(beside, V, [KT]).T) == single_faults(beside, V, [KT], payload=UNWEIGHED).T
