"""What records and their copies say together of the scatter of healthy estimates.

The copies say it much more sharply than a record, which is short, and as the very recursion runs over them they know
its own bias under coloured innovations; but they know nothing of what the model lacks.  So what a record differs by
from its copies is taken for chance as far as chance explains it, and where it does not, for what it is
(``horseshoe``).  The copies are themselves off, by what was chance in the innovations that they are made of
(``own_error``).
"""

from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration import horseshoe
from monitor_core.calibration.scatter import Scatter
from monitor_core.calibration.surrogate import Excursions

MOST_OWN = 0.5
"""Of the chance of a record, what copies of it are off by themselves."""
_TINY = 1e-300


def informed(scatter: Scatter, found: Excursions, rng: np.random.Generator) -> Scatter:
    """The scatter of the records, with what the copies know of its mean and its size."""
    p, times = len(scatter.sigma), len(scatter.power)
    own = rng.multivariate_normal(np.zeros(2 * p), found.error, size=times)
    differs = [(scatter.mean_d - found.mean) / found.sigma, np.log(scatter.sigma / found.sigma)]
    chance = [scatter.off / found.sigma, np.log(scatter.power) / 2]
    centre, apart = _told(np.concatenate(differs), np.hstack(chance), own, rng)
    return replace(
        scatter,
        mean_d=found.mean + found.sigma * centre[:p],
        off=found.sigma * apart[:, :p],
        sigma=found.sigma * np.exp(centre[p:]),
        power=np.exp(2 * apart[:, p:]),
    )


def _told(differs: Floats, chance: Floats, own: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """What to add to the copies' numbers (n,), and how far off the truth may be then (B, n).

    A record has the copies' own error in its chance, as it is of the same innovations.  So that is no part of what they
    differ by, and stays.

    Args:
        differs: what the record's numbers differ by (n,).
        chance: of the record (B, n).
        own: error of the copies (B, n).
        rng: of what is drawn.
    """
    sd, sd_own = chance.std(axis=0), own.std(axis=0)
    most = np.minimum(sd_own, MOST_OWN * sd)
    rest = np.sqrt(sd**2 - most**2)
    lacks = rest * horseshoe.drawn(differs / rest, chance / sd, rng)
    centre = lacks.mean(axis=0)
    return centre, lacks - centre + own * most / np.maximum(sd_own, _TINY)
