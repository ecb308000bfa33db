"""The core of axiswatch as a library: arrays in, arrays out, without the service.

Models and simulation:

* ``Drive, Parameter``: structure of a drive; a physical parameter of it.
* ``AxisModel``: one axis: a drive with nominal values and monitored parameters.
* ``two_mass, three_mass, five_mass, REFERENCE_VALUES``: drives of the library, the paper's values.
* ``SimulatedAxis, reference_model, experiment``: simulated axes; the paper's reference experiment.
* ``Conditions, NominalSchedule, Term, Gate, Operating``: nominal values that follow signals, gates.

Excitation:

* ``multisine, crest_factor``: signals.
* ``plan, ExcitationTask, ExcitationError``: a motion with which the parameters will be well determined.
* ``Plant, Estimation, MotionLimits``: what such a motion is planned for: drive, later estimation, largest values.
* ``Accuracy``: Cramer-Rao bound of a record.

Identification:

* ``Record, check_record``: measurements; faults found in them.
* ``Problem, Disturbance``: the parameters to estimate, and the noise.
* ``identify, IdentificationOptions, IdentificationResult, IdentificationError``: identification from records to
  nominal values, with fits, frequency responses and doubts about the values.
* ``fit, Estimate``: only the fit, from given starting values; estimates, covariance, predictor, fit.

Monitoring:

* ``Settings, Threshold``: all settings of the estimator and the tests; ``Settings.paper`` has the paper's.
* ``MonitoringOptions, recommended_settings, SettingsError``: settings for a real axis.
* ``AxisMonitor, AxisBatch, Fleet``: monitors of one axis; of axes with equal structure; of any axes.
* ``SampleBlock``: samples of one axis, as ``update`` and ``calibrate`` take them.
* ``AxisStatus, ParameterStatus, Status``: present state of an axis and of its parameters.
* ``Alarm, AlarmChange``: an alarm with name, onset and size; its change in one update.

Detection:

* ``MultiModelDetector, MultiModelThresholds``: parallel models, near the theoretical limit.
* ``least_delay``: the delay that no detector can beat (Lorden).

Long-term trend:

* ``SlowHistory, trend_of, forecast``: hourly means; their trend; the time at which it reaches a limit.

Calibration:

* ``CalibrationOptions, calibrate, CalibrationResult, CalibrationError``: thresholds for a false-alarm budget.

Each name is imported at its first use, so that a program loads only the libraries that it needs.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from monitor_core.calibration import CalibrationError, CalibrationOptions, CalibrationResult, calibrate
    from monitor_core.detection import Alarm, MultiModelDetector, MultiModelThresholds
    from monitor_core.detection.multimodel.multimodel_detector import least_delay
    from monitor_core.drive import AxisModel, Conditions, Drive, Gate, NominalSchedule, Operating, Parameter, Term
    from monitor_core.excitation import (
        Accuracy,
        Estimation,
        ExcitationError,
        ExcitationTask,
        MotionLimits,
        Plant,
        crest_factor,
        experiment,
        multisine,
        plan,
    )
    from monitor_core.identification import (
        Disturbance,
        Estimate,
        IdentificationError,
        IdentificationOptions,
        IdentificationResult,
        Problem,
        Record,
        check_record,
        fit,
        identify,
    )
    from monitor_core.modeling import (
        REFERENCE_VALUES,
        SimulatedAxis,
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
        MonitoringOptions,
        ParameterStatus,
        SettingsError,
        Status,
        recommended_settings,
    )
    from monitor_core.samples import SampleBlock
    from monitor_core.settings import Settings, Threshold
    from monitor_core.trend import SlowHistory, forecast, trend_of

_NAMES = {
    "calibration": "CalibrationError CalibrationOptions CalibrationResult calibrate",
    "detection": "Alarm MultiModelDetector MultiModelThresholds",
    "detection.multimodel.multimodel_detector": "least_delay",
    "drive": "AxisModel Conditions Drive NominalSchedule Gate Operating Parameter Term",
    "excitation": "Accuracy Estimation ExcitationError ExcitationTask MotionLimits Plant crest_factor experiment "
    "multisine plan",
    "identification": "Disturbance Estimate IdentificationError IdentificationOptions IdentificationResult Problem "
    "Record check_record fit identify",
    "modeling": "REFERENCE_VALUES SimulatedAxis five_mass reference_model three_mass two_mass",
    "monitoring": "AlarmChange AxisBatch AxisMonitor AxisStatus Fleet MonitoringOptions ParameterStatus SettingsError "
    "Status recommended_settings",
    "samples": "SampleBlock",
    "settings": "Settings Threshold",
    "trend": "SlowHistory forecast trend_of",
}
"""The names on the face of each package."""
_HOME = {name: package for package, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
