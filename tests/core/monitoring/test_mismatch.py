"""A monitor of three masses on an axis of five with all that models lack: quiet, and its faults are named.

Nominal values, gain and thresholds are those that ``identify`` and ``calibrate`` found in records of the plant, as
tests/soak/test_mismatch.py has them found for twenty plants and ten hours each.
"""

import numpy as np

from tests.core.mismatch import FAULTS, NOMINAL, MismatchPlant, after_fault, right
from tests.core.mismatch_monitor import FRICTION, watch

MINUTES, BLOCK_S = 30, 300.0


def test_half_an_hour_from_cold_is_quiet_and_faults_are_named(seed: int) -> None:
    plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch(FRICTION)
    for k in range(round(60 * MINUTES / BLOCK_S)):
        episodes, _ = monitor.take(plant.take(BLOCK_S))
        assert not episodes, (k, episodes)
    for name, (factor, seconds) in FAULTS.items():
        alarm = after_fault(plant, monitor, {name: factor}, seconds)
        print(f"{name} x {factor}: {alarm}")
        assert right(name, alarm), (name, alarm)


def test_friction_that_does_not_follow_the_temperature_alarms(seed: int) -> None:
    """A third of it is twice what a fault is."""
    plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch()
    blocks = (monitor.take(plant.take(BLOCK_S))[0] for _ in range(24))
    assert any((e.parameter, e.direction) == ("fm", "down") for raised in blocks for e in raised)


def test_a_friction_below_zero_is_none(seed: int) -> None:
    """What drives the axis, such as a load that nobody measures; less friction is a change of the friction."""
    for factor, doubt in ((-1.0, "model"), (0.3, "")):
        plant, monitor = MismatchPlant(NOMINAL, np.random.default_rng(seed)), watch(FRICTION)
        monitor.take(plant.take(120.0))
        versions, _ = monitor.take(plant.take(120.0, {"fc": factor}))
        named = {(e.parameter, e.direction, e.doubt) for e in versions if e.stage == "named"}
        assert named == {("fc", "down", doubt)}
