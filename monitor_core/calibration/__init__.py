"""Thresholds from healthy records and a false-alarm budget, and what faults they find.

``calibrate`` (``calibration_procedure``) is the whole way.  Read in this order:

* ``healthy_records``: the recursion over the records.  ``record_doubts``: whether they can be used.
* ``scatter``: how the estimates scatter in them.  ``surrogate_records``: copies of the records, and how far the sums of
  the tests go in these.  ``healthy_statistics``: both together, and by what records differ.
* ``run_length``, ``false_alarm_tail``, ``budget``: thresholds, and their rate of false alarms.
* ``injection``, ``simulated_copies``, ``fault_trials``: faults that begin anywhere in a record.
* For the multi-model detector: ``multimodel_healthy`` (the detector over the records and their copies),
  ``synthetic_innovations`` (innovations of the copies), ``multimodel_tails`` (how far g goes), ``spectra`` (what a
  record knows), ``multimodel_thresholds``, ``multimodel_fault_trials``.
* ``result``: thresholds, their rate of false alarms, and the faults that would have been found.
"""

from monitor_core.calibration.calibration_procedure import CalibrationOptions, Progress, calibrate
from monitor_core.calibration.fault_trials import TrialResult
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.calibration.result import (
    FOUND_SHARE,
    CalibrationResult,
    DetectorResult,
    MultiModelCalibration,
)

__all__ = [
    "FOUND_SHARE",
    "CalibrationError",
    "CalibrationOptions",
    "CalibrationResult",
    "DetectorResult",
    "MultiModelCalibration",
    "Progress",
    "TrialResult",
    "calibrate",
]
