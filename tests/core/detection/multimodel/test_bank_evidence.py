"""What the sums of a bank say of a change."""

import math

import numpy as np
import pytest

from monitor_core.detection.multimodel import lanes
from monitor_core.detection.multimodel.bank_evidence import BankEvidence
from monitor_core.detection.multimodel.candidates import candidate_cause
from monitor_core.detection.multimodel.hypothesis import REFERENCE
from monitor_core.detection.multimodel.naming import CausePosterior
from monitor_core.kernel.likelihood import SINCE_DETECTION, G
from tests.core.calibration.healthy_axes import plant_with

PLANT = plant_with(0.0)
H = 10.0


@pytest.fixture
def evidence() -> BankEvidence:
    """For kT -20 and +20 %, fm +40 %, and the healthy axis; no sums yet."""
    axis = (PLANT.model, PLANT.settings)
    changes = [
        candidate_cause(*axis, cause).hypothesis(size)
        for cause, size in (("kT", -0.2), ("kT", 0.2), ("fm", math.log(1.4)))
    ]
    hypotheses = (REFERENCE, *changes, REFERENCE)
    zeros = np.zeros(len(hypotheses))
    tables, predictors = lanes.lanes_of(
        *axis, hypotheses, lanes.Tests(np.array([np.inf, H, H, H, np.inf]), *(zeros,) * 3)
    )
    memory = lanes.memory_of(tables, predictors.own.shape[1])
    return BankEvidence(memory, predictors, hypotheses, CausePosterior(hypotheses[1:]), 0)


def test_a_change_lasts_while_the_samples_since_its_detection_are_not_against_it(
    evidence: BankEvidence,
) -> None:
    sums = evidence.memory.sums
    sums[G, 2] = 0.6 * H
    for since, lasts in ((5.0, True), (0.01, True), (-0.01, False)):
        sums[SINCE_DETECTION, 1:5] = -30.0, since, -30.0, -30.0
        assert (evidence.lasts(), evidence.lasts("kT"), evidence.lasts("fm")) == (lasts, lasts, False)
    sums[SINCE_DETECTION, 2] = 5.0
    sums[G, 2] = 0.4 * H
    assert not evidence.lasts("kT")


def test_crossed_likeliest_and_lane(evidence: BankEvidence) -> None:
    sums = evidence.memory.sums
    sums[G, 1:4] = 0.0, 9.0, 8.0
    before = evidence.has_crossed
    sums[G, 2] = 40.0
    assert (before, evidence.has_crossed) == (False, True)
    assert (evidence.likeliest(), evidence.lane("kT"), evidence.lane("fm")) == ("kT", 2, 3)
    first, *_ = evidence.shares()
    assert (first.cause, first.probability > 0.99) == ("kT", True)


@pytest.mark.parametrize("share", [1.0, 1 / 3])
@pytest.mark.parametrize("sums", [(0.0, 0.0, 0.0), (3.0, 4.0, 4.5), (9.0, 2.0, 8.8)])
def test_the_most_probable_cause_is_the_first_share(
    sums: tuple[float, float, float], share: float, evidence: BankEvidence
) -> None:
    evidence = evidence._replace(causes=CausePosterior(evidence.hypotheses[1:], share))
    evidence.memory.sums[G, 1:4] = sums
    first, *_ = evidence.shares()
    assert evidence.most_probable() == (first.cause, first.probability)
