"""Recursive monitoring of axes: samples in; estimates, status and alarms out.

* ``axis_monitor``: one axis, alone or as a lane of a batch; start here.
* ``axis_status``: estimates, tests and counters of an axis as plain values; parameters that are not observed.
  ``lane_status`` reads them off a batch.
* ``not_tested``: parameters that are not tested, why, and what would help.
* ``calibrated_range``: ranges of the conditions at calibration, and whether an axis is within them.
* ``known_poses``: maps of the poses at calibration.
* ``alarm_life_cycle``: states of an alarm: acknowledged, shelved, suppressed.
* ``alarm_tracker``: the open alarms of an axis, their changes, and the conditions in which they were raised.
* ``axis_batch``: the state of many axes of equal structure, and the call of the kernel.
* ``fleet``: axes of any structure, whose blocks are taken in one call.
* ``recommended_settings``: settings for a real axis.
* ``heat_observer``: the heat of an axis without a thermometer, observed from its estimates.
* ``unrecorded_heat``: starts of the motion at a heat that the records do not show.
* ``trend_monitor``: long-term trends of an axis, and alarms about limits.
"""

from monitor_core.kernel.admission import DOUBTED, GATED, IDLE, RESTART, SEED, SETTLE, SKIP, TRACK
from monitor_core.kernel.block import Trace
from monitor_core.kernel.hypotheses import BankTrace
from monitor_core.kernel.state import NEVER, UNSEEN
from monitor_core.monitoring.alarm_life_cycle import (
    ACTIVE_STATES,
    HIDDEN_STATES,
    MAX_SHELF_S,
    PRIORITIES,
    AlarmEvent,
    AlarmLife,
    AlarmRules,
    AlarmState,
    AlarmTransitionError,
    Priority,
    ShelfEndError,
    Transition,
    check_shelf,
    due,
    is_present,
    returns_us,
    transition,
)
from monitor_core.monitoring.alarm_tracker import REOPEN_MEMORIES, AlarmChange, reopen_s
from monitor_core.monitoring.axis_batch import FEWEST_LANES, AxisBatch, standard_deviation
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.axis_status import (
    AxisStatus,
    Observation,
    ParameterStatus,
    Status,
    unidentifiable_words,
)
from monitor_core.monitoring.calibrated_range import (
    MOST_NEW_POSES,
    RMS_SPEED,
    CalibratedRange,
    ConditionRange,
    ConditionTracker,
    ranges,
)
from monitor_core.monitoring.fleet import AxisTrace, Fleet
from monitor_core.monitoring.heat_observer import WarmUp, conditioned_records
from monitor_core.monitoring.known_poses import PoseMap, pose_maps
from monitor_core.monitoring.not_tested import MIN_TESTED_MEMORIES, NotTested
from monitor_core.monitoring.recommended_settings import (
    DEFAULT_MEMORY_S,
    MIN_MEMORY_SAMPLES,
    MonitoringOptions,
    SettingsError,
    recommended_settings,
    short_memory,
)
from monitor_core.monitoring.trend_monitor import ParameterLimit, ParameterTrend, TrendMonitor
from monitor_core.monitoring.unrecorded_heat import UnrecordedHeat
