"""The fit of a drive to records: criterion, search, covariance, tests of the prediction errors, doubts."""

from monitor_core.identification.greybox.comparison import (
    ComparedRecord,
    colour_of,
    explained,
    monitored_information,
    traces_of,
)
from monitor_core.identification.greybox.estimate import Estimate, agreeing
from monitor_core.identification.greybox.fitting import fit
from monitor_core.identification.greybox.residuals import LEVEL, Correlation
