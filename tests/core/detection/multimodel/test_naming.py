"""Shares and sizes, of evidence made by hand."""

import math

import numpy as np
import pytest

from monitor_core.detection.multimodel.hypothesis import Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import SURE_ENOUGH
from monitor_core.detection.multimodel.naming import CausePosterior

HYPOTHESES = (
    Hypothesis("kT", 0.1, alike=("torque scale",)),
    Hypothesis("delay", 1.0),
    Hypothesis("kT", -0.1, alike=("torque scale", "output scale")),
    Hypothesis("delay", 2.0),
    Hypothesis("noise", weight=0.1),
    Hypothesis("delay", 3.0),
)


def parabola(size: float, top: float, sd: float, height: float) -> float:
    return height - (size - top) ** 2 / (2 * sd**2)


def test_shares_sizes_and_what_is_alike() -> None:
    """Of kT the evidence is a parabola through 0 at 0, and two sizes of either sign tell it with that."""
    of_kT = {size: parabola(size, 0.04, 0.1, 0.08) for size in (0.1, -0.1)}
    of_delay = {size: parabola(size, 1.8, 0.7, 1.0) for size in (1.0, 2.0, 3.0)}
    evidence = np.array([of_kT[0.1], of_delay[1.0], of_kT[-0.1], of_delay[2.0], 2.0, of_delay[3.0]])
    found = {share.cause: share for share in CausePosterior(HYPOTHESES).shares(evidence)}
    assert (found["kT"].size, found["kT"].size_sd) == pytest.approx((0.04, 0.1))
    assert (found["delay"].size, found["delay"].size_sd) == pytest.approx((1.8, 0.7))
    assert math.isnan(found["noise"].size)
    assert found["kT"].alike == ("torque scale", "output scale")
    assert found["delay"].alike == ()
    weighed = {
        "kT": np.exp(list(of_kT.values())).sum() / 2,
        "delay": np.exp(list(of_delay.values())).sum() / 3,
        "noise": 0.1 * math.exp(8 / 9 * 2.0),  # a last resort
    }
    for cause, weight in weighed.items():
        assert found[cause].probability == pytest.approx(weight / sum(weighed.values()))
    assert list(found) == sorted(weighed, key=lambda cause: -weighed[cause])


@pytest.mark.parametrize(("lead", "sure"), [(19.0, False), (24.0, True)])
def test_a_third_of_the_evidence_counts(lead: float, sure: bool) -> None:
    """If all of it counts, a lead of 7 will do: log(0.999 / 0.001), with equal priors."""
    hypotheses = [Hypothesis("kT", 0.1), Hypothesis("fm", 0.1)]
    first, second = CausePosterior(hypotheses, 1 / 3).shares(np.array([30.0, 30.0 - lead]))
    assert (first.cause, first.probability > SURE_ENOUGH) == ("kT", sure)
    assert math.log(first.probability / second.probability) == pytest.approx(lead / 3)


def test_the_likeliest_cause_is_that_of_all_evidence() -> None:
    """A last resort needs log(10) more evidence for that; for the larger probability three times as much."""
    posterior = CausePosterior([Hypothesis("kT", 0.1), Hypothesis("noise", weight=0.1)], 1 / 3)
    evidence = np.array([9.0, 9 / 8 * (9.0 + 2 * math.log(10))])
    assert posterior.likeliest(evidence) == "noise"
    assert posterior.shares(evidence)[0].cause == "kT"


@pytest.mark.parametrize("factor", [0.8, 0.85, 1.16, 1.3, 1.5])
def test_the_size_of_a_gain_is_exact_between_two_hypotheses(factor: float) -> None:
    """The evidence for a gain is c (2 x* x - x^2) with x a factor less one, no parabola over its logarithm."""
    sizes = [sign * size for sign in (-1, 1) for size in (0.05, 0.1, 0.2, 0.4, 0.8)]
    x, true = np.expm1(sizes), factor - 1
    (found,) = CausePosterior([Hypothesis("kT", size, is_gain=True) for size in sizes]).shares(
        300 * (2 * true * x - x**2)
    )
    assert found.size == pytest.approx(math.log(factor))
    assert factor * found.size_sd == pytest.approx(math.sqrt(1 / 600))


def test_overwhelming_evidence_is_no_overflow() -> None:
    first, *others = CausePosterior(HYPOTHESES).shares(np.array([0.0, 5e3, 0.0, 1e4, 0.0, 5e3]))
    assert (first.cause, first.probability) == ("delay", 1.0)
    assert max(share.probability for share in others) < 1e-20


@pytest.mark.parametrize(("other", "sure"), [(850.0, True), (930.0, False)])
def test_a_cause_that_explains_nearly_as_much_is_not_ruled_out(other: float, sure: bool) -> None:
    """However much evidence there is: a model that is a little wrong makes up for that."""
    first, *_ = CausePosterior(HYPOTHESES).shares(np.array([1000.0, other, 0.0, 0.0, 0.0, 0.0]))
    assert first.cause == "kT"
    assert (first.probability > SURE_ENOUGH) is sure


def test_a_size_between_impossible_neighbours_has_no_standard_deviation() -> None:
    """A predictor that diverged has no evidence at all."""
    hypotheses = [Hypothesis("kT", size, is_gain=True) for size in (-0.2, -0.1, 0.1, 0.2)]
    (found,) = CausePosterior(hypotheses).shares(np.array([-np.inf, -np.inf, 3.0, -np.inf]))
    assert found.size == pytest.approx(0.1)
    assert math.isnan(found.size_sd)
