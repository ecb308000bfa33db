"""Rules for a file of thresholds: it is one, and nothing in the configuration is said twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from service.config.base_table import ABSENT, Absent
from service.config.positions import Keys
from service.config.schema import AxisConfig
from service.config.thresholds_file import ThresholdsError, ThresholdsFile, read_thresholds
from service.config.validation_messages import Finding

FILE: Keys = ("model", "thresholds_file")


def readable(axis: AxisConfig) -> Iterator[Finding]:
    """The file is there and is what it should be."""
    if axis.model.thresholds_file is not None:
        try:
            read_thresholds(axis.model.thresholds_file)
        except ThresholdsError as error:
            yield Finding(FILE, str(error))


def same_parameters(axis: AxisConfig) -> Iterator[Finding]:
    """It has a threshold for every monitored parameter, and for no other."""
    found = _found(axis)
    of = [one.parameter for one in found.threshold]
    if of != list(axis.model.monitor):
        watched = ", ".join(axis.model.monitor)
        message = f"has thresholds of {', '.join(of)}, but {watched} are monitored: calibrate again"
        yield Finding(FILE, message)


def said_once(axis: AxisConfig) -> Iterator[Finding]:
    """Thresholds that the configuration gives, too, are those of the file."""
    found = _found(axis)
    for key in ("alpha_1", "alpha_2"):
        given = getattr(axis.detector, key) if key in axis.detector.model_fields_set else ABSENT
        if given is not ABSENT and any(getattr(one, key) != given for one in found.threshold):
            message = f"but {found.path.name} has one for each parameter: remove this, or"
            yield Finding(("detector", key), message, FILE)


def _found(axis: AxisConfig) -> ThresholdsFile:
    if axis.model.thresholds_file is None:
        raise Absent("thresholds_file")
    try:
        return read_thresholds(axis.model.thresholds_file)
    except ThresholdsError:
        raise Absent("thresholds_file") from None


THRESHOLDS_RULES: tuple[Callable[[AxisConfig], Iterator[Finding]], ...] = (
    readable,
    same_parameters,
    said_once,
)
