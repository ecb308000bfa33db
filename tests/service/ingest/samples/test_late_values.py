"""A torque that comes late is taken with the motion that it has caused, whatever the blocks, and never with another."""

import numpy as np

from monitor_core.samples import SampleBlock, concatenate
from service.config.schema import AxisConfig, Config, FurtherSignalConfig
from service.ingest.samples.late_values import LateValues
from service.ingest.samples.motion_derivatives import derivative_late

H_S, N, LATE = 0.004, 300, 2


def axis(late: float) -> AxisConfig:
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


SPEED = FurtherSignalConfig(name="speed", axis="a", speed=True)


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


def test_half_a_sample_is_the_mean_of_the_two_beside_it(seed: int) -> None:
    """Whatever the blocks; where either is missing there is none."""
    rng = np.random.default_rng(seed)
    t_us = 4000 * np.arange(N, dtype=np.int64)
    sent = SampleBlock(t_us, rng.normal(size=N), np.arange(N, dtype=np.float64))
    come = np.delete(np.arange(N), 100)
    cuts = np.sort(rng.integers(0, come.size, 12)).tolist()
    shift = LateValues(axis(1.5))
    found = concatenate([shift.paired(sent.select(part)) for part in np.split(come, cuts)])
    with_both = np.setdiff1d(np.arange(N - 2), [98, 99, 100])
    np.testing.assert_array_equal(found.y, with_both)
    np.testing.assert_array_equal(found.u, (sent.u[with_both + 1] + sent.u[with_both + 2]) / 2)
    assert shift.unpaired == 2


def test_a_derivative_is_that_of_the_middle_to_the_next_sample_and_unknown_before_a_gap() -> None:
    t_us = 4000 * np.arange(N, dtype=np.int64)
    number = np.arange(N, dtype=np.float64)
    come = np.delete(np.arange(N), np.arange(100, 120))
    received = SampleBlock(t_us, number, number, signals=number[:, np.newaxis] - derivative_late(H_S)).select(come)
    found = LateValues(axis(0), [SPEED]).paired(received)
    assert found.signals is not None
    speed = found.signals[:, 0]
    near = derivative_late(H_S) + 1
    complete = (found.y < 100 - near) | (found.y >= 120)
    np.testing.assert_array_equal(speed[complete], found.y[complete] + 0.5)
    assert np.isnan(speed[(found.y >= 100 - near) & (found.y < 100)]).all()
