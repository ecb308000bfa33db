"""Records, and what is wrong with them before anything is fitted: in words, with the number that shows it.

A finding that refuses says that no fit to this record can be trusted; one that warns names what the user should look
at.  Thresholds are set so that a healthy record gives no finding: each constant says why it is what it is.
"""

from monitor_core.identification.records.arm_links import link_weights
from monitor_core.identification.records.late_torque import samples_late
from monitor_core.identification.records.link_ratios import gear_ratios
from monitor_core.identification.records.measured_record import UNITS, Known, Record, between, lively_parts
from monitor_core.identification.records.motion_checks import (
    has_wrong_sign,
    is_about_nominal,
    known_of,
    shown_inertia,
    suspicions,
)
from monitor_core.identification.records.rigid_body import rigid_fit, speed_scales
from monitor_core.identification.records.turning_weight import TurningWeight, turning_weight
from monitor_core.identification.records.value_patterns import (
    Span,
    held_for,
    stuck_spans,
    whole_numbers,
    wrap_of,
)
