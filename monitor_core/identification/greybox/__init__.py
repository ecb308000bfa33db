"""The fit of a drive to records: criterion, search, covariance, tests of the prediction errors, doubts."""

from monitor_core.identification.greybox.comparison import Comparison, Trace, colour_of, compare, traces_of
from monitor_core.identification.greybox.estimate import Estimate
from monitor_core.identification.greybox.estimation import fit
from monitor_core.identification.greybox.residuals import LEVEL, Correlation
from monitor_core.identification.problem import Disturbance, Problem

__all__ = [
    "LEVEL", "Comparison", "Correlation", "Disturbance", "Estimate", "Problem", "Trace", "colour_of",
    "compare", "fit", "traces_of",
]  # fmt: skip
