"""The laws of the elimination with drives of up to nine masses, with 1000 examples each."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.core.modeling import test_elimination_laws as laws
from tests.core.modeling.random_drives import drives

pytestmark = pytest.mark.soak

EXAMPLES, MASSES = 1000, 9
MANY = settings(
    deadline=None,
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
DRIVES = drives(most=MASSES)


def law(test: Callable[..., None], **drawn: st.SearchStrategy[object]) -> Callable[[], None]:
    """The same law with other examples."""
    return MANY(given(**drawn)(test.hypothesis.inner_test))  # type: ignore[attr-defined]


LAWS = {
    "exact": law(
        laws.test_a_reduced_drive_is_the_unreduced_one_exactly_and_minimal, drive=DRIVES, points=laws.POINTS
    ),
    "frequency response": law(
        laws.test_frequency_response_in_floating_point, drive=drives(most=6), frequency=st.floats(0.1, 30)
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_longer_drives(name: str) -> None:
    LAWS[name]()
