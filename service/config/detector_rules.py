"""Rules for an axis's detectors: the bank of hypotheses is only said to alarm where it can."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from service.config.base_table import Absent
from service.config.nominal import nominal_file_of
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.thresholds_file import thresholds_file_of
from service.config.validation_messages import Finding

KIND: Keys = ("detector", "alarm_source")
INSTEAD = 'use "cusum"'


def follows(axis: AxisConfig) -> bool:
    """Whether nominal values follow signals."""
    found = nominal_file_of(axis)
    return bool(axis.model.schedule) or (found is not None and bool(found.schedule))


def told_apart(axis: AxisConfig) -> Iterator[Finding]:
    """What the nominal values cannot tell apart no detector can."""
    found = nominal_file_of(axis)
    if axis.detector.alarm_source == "multimodel" and found is not None and found.untold(axis.model.monitor):
        pairs = ", ".join(" and ".join(pair) for pair in found.untold(axis.model.monitor))
        yield Finding(KIND, f"the nominal values cannot tell {pairs} apart: identify the axis again")


def its_own_thresholds(axis: AxisConfig) -> Iterator[Finding]:
    """A file of thresholds that was made without the bank has none for it."""
    found = thresholds_file_of(axis)
    if found is None:
        if axis.model.thresholds_file is not None:
            raise Absent("thresholds_file")
        return
    if axis.detector.alarm_source == "multimodel" and not found.hypothesis:
        message = f"{found.path.name} has no thresholds of the bank: calibrate again, or {INSTEAD}"
        yield Finding(KIND, message)
    if found.hypothesis and "budget_s" in axis.detector.model_fields_set:
        message = f"{found.path.name} has thresholds of the bank: remove this, or"
        yield Finding(("detector", "budget_s"), message, ("model", "thresholds_file"))


DETECTOR_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    told_apart,
    its_own_thresholds,
)
