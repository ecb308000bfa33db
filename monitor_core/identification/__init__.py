"""Off-line identification: from records to nominal parameters with their uncertainty (paper, sections 4 and 6.1).

* ``identification_procedure``: ``identify``, the complete procedure; ``identification_result``: its result;
  ``problem``, ``parameter_selection``: the estimated parameters; ``friction_scale``, ``holding``: two steps.
* ``records``: records.  ``record_checks``: checks whether they can be used.
* ``torque_balance``: the axis as one rigid mass, by linear least squares.  ``weight``: the weight that the axis bears.
* ``predictor``: prediction errors of a drive.  ``greybox``: fit of a drive to records.
* ``starting``: starting values, and the number of masses.
* ``thermal``: friction that depends on an unmeasured heat.
* ``assessment``: the verdict on a fit, the parameters that can be monitored, comparison of frequency responses.
* ``black_boxes``: models without physics, and frequency responses.
"""

from monitor_core.identification.assessment.bode import Bode
from monitor_core.identification.assessment.drive_response import drive_response
from monitor_core.identification.assessment.outlook import Obstacle, Watched
from monitor_core.identification.assessment.verdict import Effect, FitQuality, Measure, Verdict, VerdictBasis
from monitor_core.identification.black_boxes.arx import fit_arx
from monitor_core.identification.black_boxes.frequency_response import FrequencyResponse
from monitor_core.identification.greybox import LEVEL, ComparedRecord, Correlation, Estimate, fit
from monitor_core.identification.identification_procedure import (
    MOST_MASSES,
    USUAL_MASSES,
    IdentificationProgress,
    identify,
)
from monitor_core.identification.identification_result import (
    IdentificationOptions,
    IdentificationResult,
    ParameterRow,
    Rejection,
    Start,
)
from monitor_core.identification.parameter_selection import (
    ParameterSelection,
    ScheduledTerm,
    ScheduledTerms,
    Slope,
    scheduled_terms,
    select_parameters,
    with_schedule,
    with_terms,
)
from monitor_core.identification.problem import Disturbance, IdentificationError, PredictorKind, Problem
from monitor_core.identification.record_checks.known_axis import KnownAxis, known_axis
from monitor_core.identification.record_checks.matching_torques import matching_torques
from monitor_core.identification.record_checks.motion_checks import (
    check_record,
    exchanged_share,
    has_wrong_sign,
    is_about_nominal,
    shown_inertia,
)
from monitor_core.identification.record_checks.receipt_times import is_smoother_evenly, received_interval
from monitor_core.identification.record_checks.value_patterns import (
    Span,
    held_for,
    moves,
    stuck_spans,
    whole_numbers,
    wrap_of,
)
from monitor_core.identification.records.measured_record import Record, top_speed
from monitor_core.identification.records.record_parts import GapCut, RecordPart, between, cut_at_gaps, most_moving_parts
from monitor_core.identification.starting import Growth
from monitor_core.identification.thermal.warm_up import FoundWarmUp
from monitor_core.identification.torque_balance.contact_force import ContactForce, contact_force
from monitor_core.identification.torque_balance.late_torque import samples_late
from monitor_core.identification.torque_balance.rigid_body import rigid_fit, speed_scales
from monitor_core.identification.torque_balance.torque_time import TorqueTime, times_of_robot, torque_time
from monitor_core.identification.torque_balance.torque_windows import leaves_much_less
from monitor_core.identification.weight.arm_contact import arm_contact
from monitor_core.identification.weight.arm_energies import MotionSignals
from monitor_core.identification.weight.arm_links import ArmSignals, LinkWeights
from monitor_core.identification.weight.arm_load import ArmLoad, arm_load, motor_angles, recorded_signals
from monitor_core.identification.weight.motor_coupling import (
    CouplingFactor,
    MotorCoupling,
    likely_coupling,
    motor_coupling,
)
from monitor_core.identification.weight.turning_weight import TurningWeight, turning_weight
