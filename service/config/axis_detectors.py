"""The detectors of an axis: which one raises alarms, and whether the multi-model detector runs in shadow mode."""

import math
from typing import NamedTuple

from monitor_core.detection import (
    DetectorName,
    HypothesisThreshold,
    MultiModelDetector,
    MultiModelThresholds,
    reason_unavailable,
)
from monitor_core.drive import HEAT, AxisModel, Term
from monitor_core.settings import Settings
from monitor_core.wording import duration
from service.config.axis_settings import AxisError, axis_settings
from service.config.conditions import has_ambient_heat, schedules_of
from service.config.drives import axis_model
from service.config.schema import AxisConfig, NamedAxis


class Detectors(NamedTuple):
    """The detectors of one axis."""

    alarm_source: DetectorName
    multimodel: MultiModelDetector | None
    """The multi-model detector; None: it does not run"""
    why: str
    """Why the multi-model detector does not run, or the source of its thresholds"""


def detectors_of(axis: NamedAxis, model: AxisModel, settings: Settings) -> Detectors:
    """The configured detectors.

    By default the multi-model detector raises alarms if it has thresholds from a healthy record, and the nominal
    values are constant or follow only the warm-up state of an axis whose hall is always as warm.

    Raises:
        AxisError: the multi-model detector is the alarm source, but is not available.
    """
    wanted = axis.config.detector
    if reason := reason_unavailable(model, settings):
        if wanted.alarm_source == "multimodel":
            raise AxisError(f"{axis.id}: the multi-model detector cannot run: {reason}")
        return Detectors("cusum", None, reason)
    thresholds = axis.config.model.thresholds_file
    found = () if thresholds is None else thresholds.hypothesis
    source = alarm_source_of(axis.config, from_record=bool(found))
    if source == "cusum" and not wanted.shadow:
        return Detectors("cusum", None, "")
    own = tuple(
        HypothesisThreshold(h.cause, math.nan if h.size is None else h.size, h.h, h.allowance, h.alike, h.size_error)
        for h in found
    )
    share = 1.0 if thresholds is None or thresholds.naming is None else thresholds.naming.evidence_share
    try:
        multimodel = MultiModelDetector(
            model, settings, MultiModelThresholds(wanted.budget_s / settings.interval_s, own, share)
        )
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None
    why = "h from its records" if found else f"guaranteed h, 1 in {duration(wanted.budget_s)}"
    return Detectors(source, multimodel, why)


def alarm_source_of(axis: AxisConfig, from_record: bool) -> DetectorName:
    """The alarm source of an axis that can have both detectors; ``from_record``: with thresholds from a record."""
    # Model errors are larger if measured conditions change the model: then the paper's tests raise alarms by default.
    # The error that a warm-up correction leaves is known from the records and calibrated, but not that of a hall which
    # is colder or warmer.  Only the paper's tests have an allowance that grows with it, and, with "widen", outside the
    # range of the records.
    known = not (has_ambient_heat(axis) or axis.detector.outside_calibration == "widen") and all(
        Term.read(v.signal).signals == (HEAT,) for _, v in schedules_of(axis)
    )
    by_models = from_record and (known or not schedules_of(axis))
    return axis.detector.alarm_source or ("multimodel" if by_models else "cusum")


def detectors_in_words(axis: NamedAxis) -> str:
    """The alarm source and the detector in shadow mode, in words."""
    model = axis_model(axis.config)
    found = detectors_of(axis, model, axis_settings(axis, model))
    if found.alarm_source == "multimodel":
        return f"alarms: multimodel ({found.why})"
    return "alarms: cusum" + ("" if found.multimodel is None else " (multimodel in shadow mode)")
