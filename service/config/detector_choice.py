"""The detectors of an axis: which one raises alarms, and whether the multi-model detector runs in shadow mode."""

from __future__ import annotations

from typing import NamedTuple

from monitor_core.detection import DetectorName, Limit, Limits, MultiModelDetector, reason_unavailable
from monitor_core.drive import AxisModel
from monitor_core.settings import Settings
from monitor_core.wording import duration
from service.config.axis_settings import AxisError, axis_model, axis_settings
from service.config.conditions import varying_of
from service.config.schema import AxisConfig, NamedAxis
from service.config.thresholds_file import thresholds_file_of


class Detectors(NamedTuple):
    """The detectors of one axis."""

    alarm_source: DetectorName
    multimodel: MultiModelDetector | None
    """None: it does not run"""
    why: str
    """Why it does not run, or where its thresholds are from"""


def detectors_of(axis: NamedAxis, model: AxisModel, settings: Settings) -> Detectors:
    """The detectors as configured.

    By default the multi-model detector raises alarms where it has thresholds from a healthy record and the nominal
    values are constant.

    Raises:
        AxisError: the multi-model detector is the alarm source, but is not available.
    """
    wanted = axis.config.detector
    if reason := reason_unavailable(model, settings):
        if wanted.alarm_source == "multimodel":
            raise AxisError(f"{axis.id}: the multi-model detector cannot run: {reason}")
        return Detectors("cusum", None, reason)
    thresholds = thresholds_file_of(axis.config)
    found = () if thresholds is None else thresholds.hypothesis
    source = alarm_source_of(axis.config, from_record=bool(found))
    if source == "cusum" and not wanted.shadow:
        return Detectors("cusum", None, "")
    limits = tuple(Limit(h.cause, h.size_or_nan, h.h, h.allowance, h.alike) for h in found)
    try:
        multimodel = MultiModelDetector(
            model, settings, Limits(wanted.budget_s / settings.interval_s, limits)
        )
    except ValueError as error:
        raise AxisError(f"{axis.id}: {error}") from None
    why = "h from its records" if found else f"guaranteed h, 1 in {duration(wanted.budget_s)}"
    return Detectors(source, multimodel, why)


def alarm_source_of(axis: AxisConfig, from_record: bool) -> DetectorName:
    """The alarm source of an axis that can have both detectors, with or without thresholds from a healthy record."""
    # Model errors are larger where conditions change the model: there the paper's tests alarm by default.
    constant = not varying_of(axis)
    return axis.detector.alarm_source or ("multimodel" if from_record and constant else "cusum")


def configured_detectors(axis: NamedAxis) -> Detectors:
    """``detectors_of`` the axis with its own model and settings.

    Raises:
        AxisError: the axis cannot be monitored as configured.
    """
    model = axis_model(axis.config)
    return detectors_of(axis, model, axis_settings(axis, model))


def in_words(axis: NamedAxis) -> str:
    """Which detector alarms, and which one runs in shadow mode.

    Raises:
        AxisError: the axis cannot be monitored as configured.
    """
    found = configured_detectors(axis)
    if found.alarm_source == "multimodel":
        return f"alarms: multimodel ({found.why})"
    return "alarms: cusum" + ("" if found.multimodel is None else " (multimodel in shadow mode)")
