"""Off-line identification: from records to nominal parameters with their uncertainty (paper, sections 4 and 6.1).

* ``identification_procedure``: the whole way, ``identify``; ``identification_result``: what it returns;
  ``parameter_selection``, ``schedule``: what is estimated.
* ``record``, ``record_checks``, ``resampling``: records, and whether they can be used.
* ``problem``, ``parameter_vector``, ``predictor``, ``criterion``, ``greybox``, ``covariance``: the fit of a drive.
* ``starting``: values to start from, and the number of masses.
* ``arx``, ``blackbox``, ``subspace``, ``frequency``, ``spectral``, ``local_polynomial``: models to compare with.
"""

from monitor_core.identification.arx import fit_arx
from monitor_core.identification.blackbox import fit_blackbox
from monitor_core.identification.bode import Bode
from monitor_core.identification.frequency import FrequencyResponse
from monitor_core.identification.greybox import Disturbance, Problem, fit
from monitor_core.identification.identification_procedure import (
    MOST_MASSES,
    USUAL_MASSES,
    IdentificationOptions,
    Progress,
    Start,
    identify,
)
from monitor_core.identification.identification_result import IdentificationResult, ParameterRow, Rejection
from monitor_core.identification.parameter_selection import (
    ParameterSelection,
    select_parameters,
    with_schedule,
)
from monitor_core.identification.problem import IdentificationError, Predictor
from monitor_core.identification.record import UNITS, Record, between
from monitor_core.identification.record_checks import Finding, Known, known_of, suspicions
from monitor_core.identification.residuals import LEVEL, Correlation
from monitor_core.identification.schedule import Schedule, Slope, scheduled_terms, with_terms
from monitor_core.identification.starting import Growth
from monitor_core.identification.traces import Trace

__all__ = [
    "LEVEL",
    "MOST_MASSES",
    "UNITS",
    "USUAL_MASSES",
    "Bode",
    "Correlation",
    "Disturbance",
    "Finding",
    "FrequencyResponse",
    "Growth",
    "IdentificationError",
    "IdentificationOptions",
    "IdentificationResult",
    "Known",
    "ParameterRow",
    "ParameterSelection",
    "Predictor",
    "Problem",
    "Progress",
    "Record",
    "Rejection",
    "Schedule",
    "Slope",
    "Start",
    "Trace",
    "between",
    "fit",
    "fit_arx",
    "fit_blackbox",
    "identify",
    "known_of",
    "scheduled_terms",
    "select_parameters",
    "suspicions",
    "with_schedule",
    "with_terms",
]
