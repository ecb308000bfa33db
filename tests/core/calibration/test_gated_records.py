"""Calibration of an axis that gates leave out at times: what is counted, and what copies are made of."""

import numpy as np

from monitor_core.calibration.healthy_records import deviations
from monitor_core.calibration.surrogate_records import copy_source
from tests.core.calibration.healthy_axes import plant_with, record

PLANT = plant_with(0.0, memory=100)


def test_what_a_gate_leaves_out_is_counted_and_not_copied(seed: int) -> None:
    ungated = record(PLANT, seed, 6000)
    is_open = np.arange(6000) % 1000 < 600
    gated = ungated._replace(gate=is_open)
    (found,) = deviations(PLANT.axis, [gated])
    late = np.arange(6000) >= found.seeding
    assert 0 < found.seeding < 5000
    assert found.gated == np.count_nonzero(late & ~is_open)
    assert not found.tested[~is_open].any()
    source = copy_source(PLANT.axis, gated)
    assert source is not None
    first = 6000 - len(record_after(ungated.u, source.u[0]))
    np.testing.assert_array_equal(source.u, ungated.u[first:][is_open[first:]])


def record_after(u: np.ndarray, value: float) -> np.ndarray:
    """The torque from this value on."""
    return u[int(np.flatnonzero(u == value)[0]) :]
