"""The share of the evidence that counts, from trials whose causes are known."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from monitor_core.calibration.evidence_share import evidence_share
from monitor_core.calibration.fault_trials import TrialResult
from monitor_core.calibration.injection import InjectedFault

CAUSES = ("kT", "fc", "torque offset")


def trial(parameter: str, *causes: dict[str, float]) -> TrialResult:
    many = len(causes)
    return TrialResult(
        InjectedFault(parameter, 0.2), True, np.ones(many), (parameter,) * many, ("up",) * many, math.nan, causes
    )


def drawn(share: float, many: int, seed: int) -> Iterator[TrialResult]:
    """True causes drawn with p^share, so that ``share`` of the evidence in p is right."""
    rng = np.random.default_rng(seed)
    for _ in range(many):
        log_p = 6.0 * rng.standard_normal(3)
        right, seen = (np.exp(s * log_p) / np.exp(s * log_p).sum() for s in (share, 1.0))
        true = CAUSES[rng.choice(3, p=right)]
        yield trial(true, dict(zip(CAUSES, seen.tolist(), strict=True)))


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_the_share_with_which_the_causes_were_drawn_is_found(share: float, seed: int) -> None:
    assert evidence_share(list(drawn(share, 3000, seed))) == pytest.approx(share, rel=0.15)


def test_all_of_it_counts_where_the_probabilities_are_right(seed: int) -> None:
    assert evidence_share(list(drawn(1.0, 3000, seed))) > 0.85
    assert evidence_share([trial("kT", {"kT": 0.99, "fc": 0.01})]) == 1.0


def test_certain_names_that_are_wrong_make_it_small() -> None:
    wrong, right = {"kT": 0.0, "fc": 1.0}, {"kT": 1.0 - 1e-4, "fc": 1e-4}
    assert evidence_share([trial("kT", wrong, right)]) == pytest.approx(0.1, abs=1e-3)


def test_changes_without_a_name_do_not_count() -> None:
    assert evidence_share([]) == 1.0
    assert evidence_share([trial("kT", {}, {}), trial("fm", {"kT": 1.0, "fc": 0.0})]) == 1.0
