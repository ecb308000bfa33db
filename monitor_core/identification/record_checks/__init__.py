"""What is wrong with a record, or may be, before anything is fitted to it: in words, with the number that shows it.

A finding that refuses says that no fit to this record can be trusted; one that warns names what the user should look
at.  Thresholds are set so that a healthy record gives no finding: each constant says why it is what it is.
"""

from monitor_core.identification.record_checks.all_checks import known_of, suspicions
from monitor_core.identification.record_checks.finding import Finding, Known, Severity
from monitor_core.identification.record_checks.outlier_checks import outliers

__all__ = ["Finding", "Known", "Severity", "known_of", "outliers", "suspicions"]
