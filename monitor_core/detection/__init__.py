"""Detectors of changes: from estimates and innovations to alarms that name the cause, its onset and its size.

* ``alarm``: an alarm and its parts; the form in which alarms are saved.
* ``detector``: what every detector has in common, and the events from which alarms are made.
* ``cusum``: the paper's two CUSUM tests of each parameter.  The kernel computes g; here they become alarms.
* ``multimodel``: parallel hypotheses, one predictor for each possible fault; finds sensor faults, too.
* ``isolation``: the likeliest single fault; ``onset``, ``change_time``: when it began, suddenly or gradually.
"""

from monitor_core.detection.alarm import (
    DIRECTIONS,
    NO_PARAMETER,
    Alarm,
    AlarmKey,
    Cause,
    Direction,
    Doubt,
    Kind,
    Name,
    Reach,
    Stage,
)
from monitor_core.detection.cusum.cusum_events import Crossing, CusumEvent, Evidence, Recovered
from monitor_core.detection.detector import Detector, DetectorName, Leading
from monitor_core.detection.multimodel.candidates import (
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    SENSOR_FAULTS,
    TORQUE_LOST,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
)
from monitor_core.detection.multimodel.detection_limit import least_delay
from monitor_core.detection.multimodel.hypothesis import HEALTHY, Hypothesis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank, default_hypotheses
from monitor_core.detection.multimodel.multimodel_detector import (
    Limit,
    Limits,
    MultiModelDetector,
    bank_of,
    guaranteed,
    reason_unavailable,
)

__all__ = [
    "DIRECTIONS",
    "HEALTHY",
    "NO_PARAMETER",
    "OUTPUT_NOISE",
    "OUTPUT_OFFSET",
    "OUTPUT_SCALE",
    "OUTPUT_SIGN",
    "OUTPUT_STUCK",
    "SENSOR_FAULTS",
    "TORQUE_LOST",
    "TORQUE_OFFSET",
    "TORQUE_SCALE",
    "TORQUE_SIGN",
    "TORQUE_STUCK",
    "Alarm",
    "AlarmKey",
    "Cause",
    "Crossing",
    "CusumEvent",
    "Detector",
    "DetectorName",
    "Direction",
    "Doubt",
    "Evidence",
    "Hypothesis",
    "HypothesisBank",
    "Kind",
    "Leading",
    "Limit",
    "Limits",
    "MultiModelDetector",
    "Name",
    "Reach",
    "Recovered",
    "Stage",
    "bank_of",
    "default_hypotheses",
    "guaranteed",
    "least_delay",
    "reason_unavailable",
]
