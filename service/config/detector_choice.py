"""Which detector of an axis alarms, and which looks on: the paper's CUSUM tests, or the bank of hypotheses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from monitor_core.calibration.doubts import duration
from monitor_core.detection.detector_protocol import DetectorName
from monitor_core.detection.multimodel.multimodel_detector import Limit, Limits, MultiModelDetector, unfit
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings
from service.config import AxisConfig, Config, NamedAxis, thresholds_file_of
from service.config.axis_settings import AxisError, axis_model, axis_settings
from service.config.detector_rules import follows


class Detectors(NamedTuple):
    """Of one axis.  ``beside`` is the bank, None where it does not run; ``why`` says so, or which h it has."""

    alarms: DetectorName
    beside: MultiModelDetector | None
    why: str


def detectors_of(axis: NamedAxis, model: AxisModel, settings: Settings) -> Detectors:
    """As configured.  Unless said, the bank alarms where it has thresholds from a healthy record and fixed nominals.

    Raises:
        AxisError: the bank is to alarm, and cannot.
    """
    wanted = axis.config.detector
    if reason := unfit(model, settings):
        if wanted.kind == "bank":
            raise AxisError(f"{axis.id}: the bank of hypotheses cannot watch it: {reason}")
        return Detectors("cusum", None, reason)
    limits, from_record = _limits(axis, settings)
    alarms = alarming(axis.config, from_record)
    if alarms == "cusum" and not wanted.beside:
        return Detectors("cusum", None, "")
    try:
        beside = MultiModelDetector(model, settings, limits)
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None
    why = "h from its records" if from_record else f"guaranteed h, 1 in {duration(wanted.budget_s)}"
    return Detectors(alarms, beside, why)


def alarming(axis: AxisConfig, from_record: bool) -> DetectorName:
    """Which detector alarms of an axis that can have both, with thresholds of the bank from a healthy record or not."""
    # What the model lacks is larger where conditions change it: there the paper's tests alarm, unless said.
    return axis.detector.kind or ("bank" if from_record and not follows(axis) else "cusum")


def _limits(axis: NamedAxis, settings: Settings) -> tuple[Limits, bool]:
    """When the bank alarms, and whether that comes from a healthy record."""
    samples = axis.config.detector.budget_s / settings.interval_s
    found = thresholds_file_of(axis.config)
    own = () if found is None else found.hypothesis
    limits = tuple(Limit(one.cause, one.size_or_nan, one.h, one.allowance, one.alike) for one in own)
    return Limits(samples, limits), bool(limits)


def in_words(axis: NamedAxis) -> str:
    """Which detector alarms, and which looks on.

    Raises:
        AxisError: the axis cannot be monitored as configured.
    """
    found = _found(axis)
    if found.alarms == "bank":
        return f"alarms: bank ({found.why})"
    return "alarms: cusum" + ("" if found.beside is None else " (bank looks on)")


def remarks_on_detectors(config: Config) -> Iterator[str]:
    """What is to be known of the detectors of the axes, in words."""
    for axis in config.axes:
        found, own = _found(axis), axis.config.detector
        if found.beside is None and own.beside and found.why:
            yield f"{axis.id}: the bank of hypotheses does not watch it: {found.why}. The CUSUM tests alarm"
        elif found.alarms == "bank" and thresholds_file_of(axis.config) is None:
            yield (
                f"{axis.id}: the thresholds of the bank are those of the guarantee, no more than one false alarm in"
                f" {duration(own.budget_s)} if the model is exact. A real axis needs its own: `axiswatch calibrate`"
            )


def _found(axis: NamedAxis) -> Detectors:
    model = axis_model(axis.config)
    return detectors_of(axis, model, axis_settings(axis, model))
