"""The core of axiswatch as a library: arrays in, arrays out, without the service.

Models and simulation:

* ``Drive, Parameter``: structure of a drive; a physical parameter of it.
* ``AxisModel``: one axis: a drive with nominal values and monitored parameters.
* ``two_mass, three_mass, five_mass, REFERENCE_VALUES``: drives of the library, the paper's values.
* ``SimulatedAxis, reference_model, experiment``: simulated axes; the paper's reference experiment.
* ``Conditions, Follow, Gate, Operating``: nominal values that follow signals, gates.

Excitation:

* ``multisine, crest_factor``: signals.
* ``plan``: a motion within the limits of the drive.
* ``Accuracy``: Cramer-Rao bound of a record.

Identification:

* ``Record, check_record``: measurements, and what is wrong with them.
* ``Problem, Disturbance``: what is to be estimated, and the noise.
* ``identify, IdentificationOptions, IdentificationResult, IdentificationError``: the whole way from records to
  nominal values, with fits, frequency responses and doubts.
* ``fit, Estimate``: only the fit from given values; estimates, covariance, predictor, fit.

Monitoring:

* ``Settings, Threshold``: all settings; their defaults are the paper's.
* ``MonitoringOptions, recommended_settings, SettingsError``: settings for a real axis.
* ``AxisMonitor, AxisBatch, Fleet``: one axis; axes of equal structure; axes of any kind.
* ``SampleBlock``: samples of one axis, as ``update`` and ``calibrate`` take them.
* ``AxisStatus, ParameterStatus, Status``: present state.
* ``Alarm, AlarmChange``: an alarm with name, onset and size; what became of it in one update.

Detection:

* ``MultiModelDetector, Limits``: parallel models, near the theoretical limit.
* ``least_delay``: the delay that no detector can beat (Lorden).

Long-term trend:

* ``SlowHistory, trend_of, forecast``: hourly means, their trend, when a limit is reached.

Calibration:

* ``CalibrationOptions, calibrate, CalibrationResult, CalibrationError``: thresholds for a false-alarm budget.

A name is imported when it is first used, so that a program loads only the libraries that it needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from monitor_core.calibration.calibration_procedure import CalibrationOptions, calibrate
    from monitor_core.calibration.record_doubts import CalibrationError
    from monitor_core.calibration.result import CalibrationResult
    from monitor_core.detection import Alarm
    from monitor_core.detection.multimodel.multimodel_detector import Limits, MultiModelDetector, least_delay
    from monitor_core.drive.axis_model import AxisModel
    from monitor_core.drive.operating_conditions import Conditions, Follow, Gate, Operating
    from monitor_core.drive.structure import Drive, Parameter
    from monitor_core.excitation.accuracy import Accuracy
    from monitor_core.excitation.design import plan
    from monitor_core.excitation.multisine_signals import crest_factor, multisine
    from monitor_core.excitation.reference_experiment import experiment
    from monitor_core.identification.greybox import Estimate, fit
    from monitor_core.identification.identification_procedure import (
        IdentificationOptions,
        IdentificationResult,
        identify,
    )
    from monitor_core.identification.problem import Disturbance, IdentificationError, Problem
    from monitor_core.identification.records import suspicions as check_record
    from monitor_core.identification.records.measured_record import Record
    from monitor_core.modeling.simulated_axis import SimulatedAxis
    from monitor_core.modeling.standard_drives import (
        REFERENCE_VALUES,
        five_mass,
        reference_model,
        three_mass,
        two_mass,
    )
    from monitor_core.monitoring import (
        AlarmChange,
        AxisBatch,
        AxisMonitor,
        AxisStatus,
        Fleet,
        ParameterStatus,
        Status,
    )
    from monitor_core.monitoring.recommended_settings import (
        MonitoringOptions,
        SettingsError,
        recommended_settings,
    )
    from monitor_core.samples import SampleBlock
    from monitor_core.settings import Settings, Threshold
    from monitor_core.trend.limit_forecast import forecast
    from monitor_core.trend.slow_history import SlowHistory
    from monitor_core.trend.trend import trend_of

__all__ = [
    "REFERENCE_VALUES",
    "Accuracy",
    "Alarm",
    "AlarmChange",
    "AxisBatch",
    "AxisModel",
    "AxisMonitor",
    "AxisStatus",
    "CalibrationError",
    "CalibrationOptions",
    "CalibrationResult",
    "Conditions",
    "Disturbance",
    "Drive",
    "Estimate",
    "Fleet",
    "Follow",
    "Gate",
    "IdentificationError",
    "IdentificationOptions",
    "IdentificationResult",
    "Limits",
    "MonitoringOptions",
    "MultiModelDetector",
    "Operating",
    "Parameter",
    "ParameterStatus",
    "Problem",
    "Record",
    "SampleBlock",
    "Settings",
    "SettingsError",
    "SimulatedAxis",
    "SlowHistory",
    "Status",
    "Threshold",
    "calibrate",
    "check_record",
    "crest_factor",
    "experiment",
    "fit",
    "five_mass",
    "forecast",
    "identify",
    "least_delay",
    "multisine",
    "plan",
    "recommended_settings",
    "reference_model",
    "three_mass",
    "trend_of",
    "two_mass",
]

_HOME = {
    "Drive": "drive.structure",
    "Parameter": "drive.structure",
    "AxisModel": "drive.axis_model",
    "two_mass": "modeling.standard_drives",
    "three_mass": "modeling.standard_drives",
    "five_mass": "modeling.standard_drives",
    "REFERENCE_VALUES": "modeling.standard_drives",
    "SimulatedAxis": "modeling.simulated_axis",
    "reference_model": "modeling.standard_drives",
    "experiment": "excitation.reference_experiment",
    "Conditions": "drive.operating_conditions",
    "Follow": "drive.operating_conditions",
    "Gate": "drive.operating_conditions",
    "Operating": "drive.operating_conditions",
    "multisine": "excitation.multisine_signals",
    "crest_factor": "excitation.multisine_signals",
    "plan": "excitation.design",
    "Accuracy": "excitation.accuracy",
    "Record": "identification.records",
    "check_record": "identification.records:suspicions",
    "Problem": "identification.problem",
    "Disturbance": "identification.problem",
    "identify": "identification.identification_procedure",
    "IdentificationOptions": "identification.identification_procedure",
    "IdentificationResult": "identification.identification_procedure",
    "IdentificationError": "identification.problem",
    "fit": "identification.greybox",
    "Estimate": "identification.greybox",
    "Settings": "settings",
    "Threshold": "settings",
    "MonitoringOptions": "monitoring.recommended_settings",
    "recommended_settings": "monitoring.recommended_settings",
    "SettingsError": "monitoring.recommended_settings",
    "AxisMonitor": "monitoring.axis_monitor",
    "AxisBatch": "monitoring.axis_batch",
    "Fleet": "monitoring.fleet",
    "AxisStatus": "monitoring.axis_status",
    "ParameterStatus": "monitoring.axis_status",
    "Status": "monitoring.axis_status",
    "Alarm": "detection.alarm",
    "AlarmChange": "monitoring.alarm_tracker",
    "SampleBlock": "samples",
    "MultiModelDetector": "detection.multimodel.multimodel_detector",
    "Limits": "detection.multimodel.multimodel_detector",
    "least_delay": "detection.multimodel.multimodel_detector",
    "SlowHistory": "trend.slow_history",
    "trend_of": "trend.trend",
    "forecast": "trend.limit_forecast",
    "CalibrationOptions": "calibration.calibration_procedure",
    "calibrate": "calibration.calibration_procedure",
    "CalibrationResult": "calibration.result",
    "CalibrationError": "calibration.record_doubts",
}
"""Module of each name, and the name there where it is another one."""


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _HOME[name].partition(":")
    value = getattr(import_module(f"{__name__}.{module}"), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
