"""The paper's Figure 6 over 1000 seeds, with the limits that so many allow."""

from __future__ import annotations

import pytest

from tests.core.figures import Table, figure_6
from tests.core.test_figures import (  # noqa: F401 -- they run here on the larger table
    test_figure_6_delays_and_g,
    test_figure_6_has_hardly_a_false_alarm,
    test_figure_6_names_the_right_parameter,
)

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def table(seed: int) -> Table:
    return figure_6(seed, 1000)
