"""Rules for an axis whose torque is watched for being late."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from monitor_core.drive.structure import DELAY
from service.config.base_table import ABSENT
from service.config.drives import drive_of
from service.config.model_rules import usable_drive
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.skew import has_own_delay, nominal_skew, watches_skew
from service.config.validation_messages import Finding


def of_the_torque(axis: AxisConfig) -> Iterator[Finding]:
    """It is the torque's, no parameter of the drive, and its nominal value stands in one place."""
    if not watches_skew(axis):
        return
    usable_drive(axis)
    if has_own_delay(drive_of(axis)):
        message = "is how late the torque acts, but the drive has a parameter of that name: rename that one"
        yield Finding(_place(axis), message)
    elif DELAY in axis.model.nominal:
        yield Finding(
            ("model", "nominal", DELAY), "its nominal value is torque_delay_s of the axis: remove this"
        )


def below_an_interval(axis: AxisConfig) -> Iterator[Finding]:
    """Beyond one interval the torque is another sample's."""
    if not watches_skew(axis):
        return
    h, bounds = axis.sample_interval_s, axis.model.bounds.get(DELAY, ABSENT)
    if bounds is not ABSENT and max(map(abs, bounds)) > h:
        yield Finding(("model", "bounds", DELAY), f"must be within sample_interval_s, [{-h}, {h}]")
    if nominal_skew(axis) >= h:
        message = f"a delay is followed up to sample_interval_s = {h}, and that is nominal here: nothing is left to see"
        yield Finding(_place(axis), message)


def _place(axis: AxisConfig) -> Keys:
    return ("model", "monitor", axis.model.monitor.index(DELAY))


SKEW_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (of_the_torque, below_an_interval)
