"""Starting values, and fits that need no guess.

From the records alone (``fit_from_scratch``): the resonances of black boxes give masses and springs in closed form, and
the dampers by linear least squares; where that leaves doubts, chains grow mass by mass out of one rigid mass.  From
values that may be wrong by a factor of three each (``fit_from``): a search from broad to narrow in the frequency
response.  Either way the best ends start the fit of the records themselves.

Where nobody knows how many masses the drive has, ``grow`` fits one, two, three, .. and says how many the records ask
for.
"""

from monitor_core.identification.starting.mass_count import Grown, Growth, grow
from monitor_core.identification.starting.search import Progress
from monitor_core.identification.starting.starting_fits import Candidate, fit_from, fit_from_scratch, start

__all__ = ["Candidate", "Grown", "Growth", "Progress", "fit_from", "fit_from_scratch", "grow", "start"]
