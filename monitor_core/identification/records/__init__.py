"""Records, and what is wrong with them before anything is fitted: in words, with the number that shows it.

A finding that refuses says that no fit to this record can be trusted; one that warns names what the user should look
at.  Thresholds are set so that a healthy record gives no finding: each constant says why it is what it is.
"""

from monitor_core.identification.records.motion_checks import known_of, slip_of, suspicions
from monitor_core.identification.records.record import UNITS, Bools, Finding, Known, Record, Severity, between
from monitor_core.identification.records.rigid_body import rigid_fit, speed_scales

__all__ = [
    "UNITS", "Bools", "Finding", "Known", "Record", "Severity", "between", "known_of", "rigid_fit", "slip_of",
    "speed_scales", "suspicions",
]  # fmt: skip
