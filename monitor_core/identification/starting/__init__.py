"""Starting values, and fits that need no guess.

From the records alone (``fit_from_scratch``): chains grow in the frequency response mass by mass, since masses and
springs follow from resonances in closed form.  From values that may be wrong by a factor of three each (``fit_from``):
a search in the frequency response, from broad to narrow.  In both cases the best results are the starts of the fit of
the records themselves.

If the number of masses is unknown, ``grow`` fits one, two, three, .. and reports how many the records support.
"""

from monitor_core.identification.starting.chains import masses_of
from monitor_core.identification.starting.mass_count import Growth, grow
from monitor_core.identification.starting.starting_fits import (
    best_of,
    fit_from,
    fit_from_scratch,
    fit_from_torque_balance,
    hold_balanced_inertia,
)
