"""Off-line identification: from records to nominal parameters with their uncertainty (paper, sections 4 and 6.1).

* ``identification_procedure``: the whole way, ``identify``; ``identification_result``: what it returns; ``problem``,
  ``parameter_selection``: what is estimated; ``holding``: what the records do not determine; ``verdict`` on the fit;
  ``outlook``: what can be watched with it; ``bode``: the drive beside black boxes and the record; ``warm_up``: friction
  that follows a heat which is not measured.
* ``records``: records, and whether they can be used.
* ``predictor``: prediction errors of a drive; ``greybox``: its fit.
* ``starting``: values to start from, and the number of masses.
* ``black_boxes``: models without physics, and frequency responses.
"""

from monitor_core.identification.black_boxes.arx import fit_arx
from monitor_core.identification.black_boxes.frequency_response import FrequencyResponse
from monitor_core.identification.bode import Bode, drive_response
from monitor_core.identification.greybox import LEVEL, Correlation, Estimate, Trace, fit
from monitor_core.identification.identification_procedure import MOST_MASSES, USUAL_MASSES, Progress, identify
from monitor_core.identification.identification_result import (
    IdentificationOptions,
    IdentificationResult,
    ParameterRow,
    Rejection,
    Start,
)
from monitor_core.identification.outlook import Obstacle, Watched
from monitor_core.identification.parameter_selection import (
    ParameterSelection,
    Schedule,
    Slope,
    scheduled_terms,
    select_parameters,
    with_schedule,
    with_terms,
)
from monitor_core.identification.problem import Disturbance, IdentificationError, Predictor, Problem
from monitor_core.identification.records import (
    UNITS,
    Known,
    Record,
    Span,
    TurningWeight,
    between,
    gear_ratios,
    has_wrong_sign,
    held_for,
    is_about_nominal,
    known_of,
    link_weights,
    lively_parts,
    rigid_fit,
    samples_late,
    shown_inertia,
    speed_scales,
    stuck_spans,
    suspicions,
    turning_weight,
    whole_numbers,
    wrap_of,
)
from monitor_core.identification.starting import Growth
from monitor_core.identification.verdict import Basis, Effect, Measure, Verdict
from monitor_core.identification.warm_up import FoundWarmUp
