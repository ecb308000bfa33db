"""Statistics of tests/core over many more records: the paper's Figure 6, and scatter of the estimates as reported."""

import numpy as np
import pytest

from monitor_core.drive.structure import Output
from tests.core.excitation.test_figures import (  # noqa: F401 -- they run here on the larger table
    test_figure_6_delays_and_g,
    test_figure_6_has_hardly_a_false_alarm,
    test_figure_6_names_the_right_parameter,
)
from tests.core.figures import Table, figure_6
from tests.core.honesty import Honesty, honesty, settings_for

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def table(seed: int) -> Table:
    """Over 1000 seeds, with the limits that so many allow."""
    return figure_6(seed, 1000)


AXES, MEMORIES, RUNS = 64, 20, 16
"""As many as 10 000 independent estimates: the ratio of deviations is known to 0.7 %."""
CASES: list[tuple[Output, float]] = [("speed", 0.0), ("speed", 0.05), ("speed", 0.3), ("angle", 0.05)]
"""Output, torque noise [N m]; the first is the output error."""


def over_runs(output: Output, torque_noise: float, time_constants: float, joint: bool, seed: int) -> Honesty:
    settings = settings_for(output, torque_noise, time_constants, joint=joint)
    runs = [honesty(output, torque_noise, settings, seed + k, AXES, MEMORIES) for k in range(RUNS)]
    found = Honesty(*(np.sqrt(np.mean(np.square(column), axis=0)) for column in zip(*runs, strict=True)))
    print(
        f"\n{output}, torque noise {torque_noise}, {time_constants} time constants, joint state {joint}:"
        f" scatter over reported {found.scatter / found.reported}, over least {found.scatter / found.least}"
    )
    return found


# The state moves with the estimates; the paper's recursion needs an ample memory.
@pytest.mark.parametrize(("output", "torque_noise"), CASES)
@pytest.mark.parametrize(("time_constants", "joint", "within"), [(1.8, True, 0.2), (9.0, True, 0.1), (9.0, False, 0.1)])
def test_reported_deviations_are_true_and_the_least(
    output: Output, torque_noise: float, time_constants: float, joint: bool, within: float, seed: int
) -> None:
    found = over_runs(output, torque_noise, time_constants, joint, seed)
    assert (abs(found.scatter / found.reported - 1) < within).all()
    assert (abs(found.scatter / found.least - 1) < 0.2).all()
