"""Cross-checks of the detectors of an axis and of its file of thresholds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from service.config.base_table import Undecidable
from service.config.nominal import nominal_file_of
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.thresholds_file import (
    ThresholdsError,
    ThresholdsFile,
    read_thresholds,
    thresholds_file_of,
)
from service.config.validation_messages import Finding

FILE: Keys = ("model", "thresholds_file")
SOURCE: Keys = ("detector", "alarm_source")
INSTEAD = 'use "cusum"'


def follows(axis: AxisConfig) -> bool:
    """Whether nominal values follow signals."""
    found = nominal_file_of(axis)
    return bool(axis.model.schedule) or (found is not None and bool(found.schedule))


def told_apart(axis: AxisConfig) -> Iterator[Finding]:
    """Parameters that the nominal values do not distinguish cannot be distinguished by a detector."""
    found = nominal_file_of(axis)
    if axis.detector.alarm_source == "multimodel" and found is not None and found.untold(axis.model.monitor):
        pairs = ", ".join(" and ".join(pair) for pair in found.untold(axis.model.monitor))
        yield Finding(SOURCE, f"the nominal values cannot tell {pairs} apart: identify the axis again")


def its_own_thresholds(axis: AxisConfig) -> Iterator[Finding]:
    """A file of thresholds that was made without the multi-model detector has none for it."""
    found = thresholds_file_of(axis)
    if found is None:
        if axis.model.thresholds_file is not None:
            raise Undecidable("thresholds_file")
        return
    if axis.detector.alarm_source == "multimodel" and not found.hypothesis:
        message = (
            f"{found.path.name} has no thresholds of the multi-model detector: calibrate again, or {INSTEAD}"
        )
        yield Finding(SOURCE, message)
    if found.hypothesis and "budget_s" in axis.detector.model_fields_set:
        message = f"{found.path.name} has thresholds of the multi-model detector: remove this, or"
        yield Finding(("detector", "budget_s"), message, ("model", "thresholds_file"))


def readable(axis: AxisConfig) -> Iterator[Finding]:
    """The file exists and is valid."""
    if axis.model.thresholds_file is not None:
        try:
            read_thresholds(axis.model.thresholds_file)
        except ThresholdsError as error:
            yield Finding(FILE, str(error))


def same_parameters(axis: AxisConfig) -> Iterator[Finding]:
    """The file has a threshold for every monitored parameter, and for no other."""
    found = _found(axis)
    names = [entry.parameter for entry in found.threshold]
    if names != list(axis.model.monitor):
        watched = ", ".join(axis.model.monitor)
        message = f"has thresholds of {', '.join(names)}, but {watched} are monitored: calibrate again"
        yield Finding(FILE, message)


def said_once(axis: AxisConfig) -> Iterator[Finding]:
    """Thresholds that are also in the configuration equal those of the file."""
    found = _found(axis)
    for key in ("alpha_1", "alpha_2"):
        given = getattr(axis.detector, key)
        is_given = key in axis.detector.model_fields_set
        if is_given and any(getattr(threshold, key) != given for threshold in found.threshold):
            message = f"but {found.path.name} has one for each parameter: remove this, or"
            yield Finding(("detector", key), message, FILE)


def _found(axis: AxisConfig) -> ThresholdsFile:
    if axis.model.thresholds_file is None:
        raise Undecidable("thresholds_file")
    try:
        return read_thresholds(axis.model.thresholds_file)
    except ThresholdsError:
        raise Undecidable("thresholds_file") from None


DETECTOR_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    readable,
    same_parameters,
    said_once,
    told_apart,
    its_own_thresholds,
)
