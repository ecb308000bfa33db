"""A torque that comes late is taken with the motion that it has caused, whatever the blocks, and never with another."""

import numpy as np

from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig, Config
from service.ingest.late_values import LateValues

H_S, N, LATE = 0.004, 300, 2


def axis(late: int) -> AxisConfig:
    """A table's axis."""
    text = {
        "name": "a",
        "sample_interval_s": H_S,
        "torque": {"column": "u", "late_samples": late},
        "angle": {"column": "y"},
        "model": {"drive": "one-mass", "monitor": ["kT"]},
    }
    (found,) = Config.model_validate({"robot": [{"name": "r", "axis": [text]}]}).axes
    return found.config


def test_each_motion_has_the_torque_that_came_later(seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = np.arange(N, dtype=np.float64)
    t_us = 4000 * np.arange(N, dtype=np.int64)
    sent = SampleBlock(t_us, number - LATE, number, signals=number[:, np.newaxis])
    come = np.sort(rng.choice(N, N - 10, replace=False))
    cuts = np.sort(rng.integers(0, come.size, 12)).tolist()
    shift = LateValues(axis(LATE))
    blocks = [sent.select(part) for part in np.split(come, cuts)]
    found = concatenate([shift.paired(block) for block in blocks])
    np.testing.assert_array_equal(found.u, found.y)
    np.testing.assert_array_equal(found.t_us, 4000 * found.y)
    assert found.signals is not None
    np.testing.assert_array_equal(found.signals[:, 0], found.y)
    # Only what is missing, and the samples whose torque is, are left out.
    assert found.size > N - LATE - 3 * 10
    assert found.size + shift.unpaired == come.size - LATE
    assert LateValues(axis(0)).paired(sent) is sent
