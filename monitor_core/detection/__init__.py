"""Detectors of changes: from estimates and innovations to alarms that name the cause, its onset and its size.

* ``alarm``: an alarm and its parts; the form in which alarms are saved.
* ``cusum``: the paper's two CUSUM tests of each parameter.  The kernel computes g; here they become alarms.
* ``multimodel``: parallel hypotheses, one predictor for each possible fault; also detects sensor faults.
* ``isolation``: the likeliest single fault; ``onset``: the time at which it began, and whether suddenly or gradually.

A detector has a ``name``, the ``causes`` that its alarms may name, and the ``leading`` cause, which is nearest its
threshold.  ``interpret`` turns its events into alarms that are raised, changed or ended; ``adopt`` takes open alarms,
as after a restart.
"""

from monitor_core.detection.alarm import (
    DIRECTIONS,
    INERTIA,
    OUTPUT_NOISE,
    OUTPUT_OFFSET,
    OUTPUT_SCALE,
    OUTPUT_SIGN,
    OUTPUT_STUCK,
    PAYLOAD_WITHIN_S,
    TORQUE_LOST,
    TORQUE_OFFSET,
    TORQUE_SCALE,
    TORQUE_SIGN,
    TORQUE_STUCK,
    Alarm,
    AlarmKey,
    Cause,
    ChangeKind,
    DetectorName,
    Direction,
    Doubt,
    FormerName,
    Reach,
    Stage,
    payload_change,
    same_payload,
)
from monitor_core.detection.cusum.cusum_evidence import Crossing
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import (
    HypothesisThreshold,
    MultiModelDetector,
    MultiModelThresholds,
    reason_unavailable,
)
