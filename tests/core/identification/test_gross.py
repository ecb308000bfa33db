"""Outliers one by one: those that are, not those that K made of them."""

import numpy as np
import pytest

from monitor_core.identification.greybox import Disturbance
from monitor_core.identification.greybox.criterion import choose_disturbance, outliers
from monitor_core.identification.predictor.prediction_errors import Predictor
from monitor_core.identification.records import Record
from tests.core.identification.problems import reference_problem, reference_record

SAMPLES = 600
LIMIT = 5.0  # standard deviations of the innovations


def predictor_of(rec: Record) -> Predictor:
    """K is large: a torque noise of .6 N m beside an output noise of .3 rad/s."""
    problem = reference_problem(predictor="innovations", disturbance=Disturbance(torque=0.6, output=0.3))
    return Predictor(problem, [rec], choose_disturbance(problem, [rec]))


def with_errors(rec: Record, which: np.ndarray, size: float) -> Record:
    y = rec.y.copy()
    y[which] += size
    return Record(rec.t, rec.u, y, rec.quantity)


@pytest.mark.parametrize(
    "which",
    [[0], [300], [300, 301], [300, 302, 305, 306], [300, 325, 350], [0, 1, 599], list(range(300, 315))],
)
def test_those_that_are(which: list[int], seed: int) -> None:
    clean = reference_record(seed, SAMPLES, noise=0.01)
    rec = with_errors(clean, np.array(which), 30.0)
    predictor = predictor_of(rec)
    xi = predictor_of(clean).start()
    [found] = outliers(predictor, xi, LIMIT)
    np.testing.assert_array_equal(np.flatnonzero(found), which)
    [e] = predictor.errors(xi)
    if 599 not in which:
        assert np.count_nonzero(np.abs(e.eps) > LIMIT) > len(which)  # K carried them on


@pytest.mark.parametrize(("size", "count"), [(0.9 * LIMIT, 0), (1.1 * LIMIT, 1)])
def test_beyond_the_limit(size: float, count: int, seed: int) -> None:
    clean = reference_record(seed, SAMPLES, noise=0.01)
    predictor = predictor_of(with_errors(clean, np.array([300]), size))
    [found] = outliers(predictor, predictor.start(), LIMIT)
    assert found.sum() == count


def test_none(seed: int) -> None:
    predictor = predictor_of(reference_record(seed, SAMPLES, noise=0.01))
    [found] = outliers(predictor, predictor.start(), LIMIT)
    assert not found.any()


def test_a_stretch_in_which_nothing_fits_counts_whole(seed: int) -> None:
    """300 samples from elsewhere: twenty looks take the first ones, the last look takes the rest."""
    rec = reference_record(seed, SAMPLES, noise=0.01)
    stretch = np.arange(200, 500)
    y = rec.y.copy()
    y[stretch] = np.random.default_rng(seed).choice([-1e3, 1e3], stretch.size)
    predictor = predictor_of(Record(rec.t, rec.u, y, rec.quantity))
    [found] = outliers(predictor, predictor.start(), LIMIT)
    assert found[stretch].mean() > 0.99
    assert not found[:200].any()
