"""What stands in a bank: causes join, are added up, end, and go through a save; what may change goes on from them."""

import math

import numpy as np
import pytest

from monitor_core.detection.multimodel.active_faults import (
    ENDED_SHARE,
    FINE_STEP,
    SECOND_CAUSE_PRIOR,
    UNEXPLAINED,
    ActiveFaults,
)
from monitor_core.detection.multimodel.candidates import candidates
from monitor_core.detection.multimodel.hypothesis import HEALTHY
from monitor_core.detection.multimodel.naming import Share
from tests.core.calibration.healthy_axes import plant_with

PLANT = plant_with(0.0)
HYPOTHESES = candidates(PLANT.model, PLANT.settings)


@pytest.fixture
def standing() -> ActiveFaults:
    return ActiveFaults(PLANT.model, PLANT.settings, HYPOTHESES)


def share(cause: str, size: float, size_sd: float = 0.01) -> Share:
    return Share(cause, 1.0, size, size_sd)


def likeliest(cause: str, size: float) -> int:
    """The hypothesis of a cause that is nearest a size."""
    own = [k for k, hypothesis in enumerate(HYPOTHESES) if hypothesis.cause == cause]
    return min(own, key=lambda k: abs(HYPOTHESES[k].size - size))


def join(standing: ActiveFaults, cause: str, size: float) -> None:
    standing.join(share(cause, size), HYPOTHESES[likeliest(cause, size)])


def test_nothing_stands_at_first_and_all_may_change(standing: ActiveFaults) -> None:
    now, *changes, back = standing.lanes()
    assert not standing
    assert (now.cause, dict(now.factors)) == (HEALTHY, {})
    assert tuple(changes) == HYPOTHESES
    assert back.weight < 1e-200


def test_what_may_change_goes_on_from_what_stands(standing: ActiveFaults) -> None:
    """kT 20 % larger: so it is in each lane but that of the way back; other causes are less likely, its steps finer."""
    join(standing, "kT", math.log(1.2))
    now, *changes, back = standing.lanes()
    assert now.factors["kT"] == pytest.approx(1.2)
    for after, before in zip(changes, HYPOTHESES, strict=True):
        assert after.factors["kT"] == pytest.approx(1.2 * before.factors.get("kT", 1.0) ** FINE_STEP)
        assert after.weight == (before.weight if after.cause == "kT" else SECOND_CAUSE_PRIOR * before.weight)
    assert "kT" not in back.factors
    assert back.cause == "kT"
    assert back.size == pytest.approx(-math.log(1.2))


def test_what_stands_leaves_a_share_unexplained_that_is_no_evidence_for_other_causes(
    standing: ActiveFaults,
) -> None:
    join(standing, "kT", math.log(1.2))
    shares = {h.cause: share for h, share in zip(HYPOTHESES, standing.unexplained(), strict=True)}
    assert shares.pop("kT") == 0.0
    assert set(shares.values()) == {UNEXPLAINED}


def test_changes_of_one_cause_add_up_and_end_together(standing: ActiveFaults) -> None:
    join(standing, "kT", 0.2)
    join(standing, "kT", 0.1)
    assert len(standing) == 1
    (total,) = standing.with_total_sizes((share("kT", 0.05),))
    assert total.size == pytest.approx(0.35)
    assert standing.ended(share("kT", -0.3 * (1 - ENDED_SHARE / 2))) == ["kT"]
    assert standing.ended(share("kT", -0.3 * (1 - 1.5 * ENDED_SHARE))) == []
    assert standing.ended(share("fm", -0.3)) == []


def test_what_is_left_below_half_of_the_smallest_step_is_nothing(standing: ActiveFaults) -> None:
    least = min(abs(h.size) for h in HYPOTHESES if h.cause == "fm")
    join(standing, "fm", 2 * least)
    for left, ended in ((0.45, True), (-0.45, True), (0.55, False)):
        assert standing.is_negligible(share("fm", left * least)) is ended
        assert standing.ended(share("fm", (left - 2) * least, 1e-6)) == ["fm"] * ended


def test_all_as_it_was_ends_all(standing: ActiveFaults) -> None:
    join(standing, "kT", 0.2)
    join(standing, "fm", 0.5)
    assert standing.ended(share(HEALTHY, math.nan)) == ["kT", "fm"]
    standing.end("kT")
    standing.end("kT")
    assert len(standing) == 1
    standing.clear()
    assert not standing


def test_it_goes_through_a_save(standing: ActiveFaults) -> None:
    join(standing, "kT", 0.2)
    join(standing, "fm", 0.5)
    other = ActiveFaults(PLANT.model, PLANT.settings, HYPOTHESES)
    other.from_array(standing.to_array())
    assert other.lanes() == standing.lanes()


def test_a_cause_that_these_hypotheses_do_not_have(standing: ActiveFaults) -> None:
    join(standing, "kT", 0.2)
    before = standing.lanes()
    with pytest.raises(ValueError, match="do not have"):
        standing.from_array(np.array([[float(len(standing.causes)), 0.2]]))
    assert standing.lanes() == before
