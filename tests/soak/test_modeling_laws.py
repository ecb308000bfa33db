"""The laws of the elimination with 1000 drives of up to nine masses."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from tests.core.modeling import test_elimination_laws as laws
from tests.core.modeling.random_drives import drives

pytestmark = pytest.mark.soak

EXAMPLES, MASSES = 1000, 9
MANY = settings(
    deadline=None,
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def test_longer_drives() -> None:
    law = laws.test_a_reduced_drive_is_the_unreduced_one_exactly_and_minimal
    same = law.hypothesis.inner_test  # type: ignore[attr-defined]
    MANY(given(drive=drives(most=MASSES), points=laws.POINTS)(same))()
