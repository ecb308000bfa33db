"""All that is suspicious about a record."""

from __future__ import annotations

from monitor_core.identification.record import Record
from monitor_core.identification.record_checks.finding import Finding, Known
from monitor_core.identification.record_checks.motion_checks import motion
from monitor_core.identification.record_checks.outlier_checks import strange
from monitor_core.identification.record_checks.signal_checks import signals
from monitor_core.identification.record_checks.time_checks import times

_NOTHING_KNOWN = Known()


def suspicions(record: Record, known: Known = _NOTHING_KNOWN) -> tuple[Finding, ...]:
    """What is wrong with a record, those findings first that refuse it.

    Torque and motion are compared only where each of them is sound by itself.
    """
    found = [*strange(record), *times(record, known), *signals(record)]
    if not any(finding.severity == "refuse" for finding in found):
        found += motion(record, known)
    return tuple(sorted(found, key=lambda finding: finding.severity != "refuse"))
