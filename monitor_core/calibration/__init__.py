"""Thresholds from healthy records and a false-alarm budget, and the faults that they detect.

``calibrate`` (``calibration_procedure``) is the whole procedure.  Read in this order:

* ``monitored_axis``: the axis to calibrate.  ``healthy_records``: the recursion over the records.  ``scatter``: scatter
  of the estimates in the records.  ``record_doubts``: checks whether the records can be used.
* ``surrogate_records``: bootstrap copies of the records, with innovations from ``innovation_bootstrap``.
  ``copy_excursions``: excursions of the CUSUM sums in the copies, and the error of the copies.
  ``healthy_statistics``: statistics of records and copies combined, and the allowance.
* ``false_alarm_tail``, ``budget``: thresholds and their false-alarm rate.
* ``injection``, ``simulated_copies``, ``fault_trials``: faults injected anywhere in a record.
* For the multi-model detector: ``multimodel_healthy`` (the detector over the records and their copies),
  ``multimodel_tails`` (tails of g), ``spectra`` (uncertainty from the length of the record),
  ``multimodel_thresholds``.
* ``result``: thresholds, their false-alarm rate, and the detected faults.
"""

from monitor_core.calibration.calibration_procedure import CalibrationOptions, CalibrationProgress, calibrate
from monitor_core.calibration.fault_trials import TrialResult
from monitor_core.calibration.record_doubts import CalibrationError
from monitor_core.calibration.result import FOUND_SHARE, CalibrationResult, DetectorResult
