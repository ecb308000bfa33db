"""What records and their copies say together of the scatter of healthy estimates.

The copies say it much more sharply than a record, which is short, and as the very recursion runs over them they know
its own bias under coloured innovations; but they know nothing of what the model lacks.  So what a record differs by
from its copies is taken for chance as far as chance explains it, and where it does not, for what it is: the horseshoe
(Carvalho, Polson and Scott 2010), which hardly shrinks what is far out.  The copies are themselves off, by what
was chance in the innovations that they are made of (``own_error``).
"""

from dataclasses import replace

import numpy as np

from monitor_core.calibration.scatter import Scatter
from monitor_core.calibration.surrogate import Excursions
from monitor_core.kernel.tables import Floats

MOST_OWN = 0.5
"""Of the chance of a record, what copies of it are off by themselves."""
_STEPS, _TINY = 2000, 1e-300
_FARTHEST = 1e3
"""Standard deviations: what is farther out is not shrunk at all, and its weights would underflow."""


def informed(scatter: Scatter, found: Excursions, rng: np.random.Generator) -> Scatter:
    """The scatter of the records, with what the copies know of its mean and its size."""
    p, times = len(scatter.sigma), len(scatter.power)
    own = rng.multivariate_normal(np.zeros(2 * p), found.error, size=times)
    own_mean, own_log = found.sigma * own[:, :p], own[:, p:]
    shift, share, stays = _told(scatter.mean_d - found.mean, scatter.mean_sd, own_mean.std(axis=0))
    log_power = np.log(scatter.power)
    differs, sd = np.log(scatter.sigma / found.sigma), log_power.std(axis=0) / 2
    larger, log_share, log_stays = _told(differs, sd, own_log.std(axis=0))
    return replace(
        scatter,
        mean_d=found.mean + shift,
        off=share * scatter.off + stays * own_mean,
        sigma=found.sigma * np.exp(larger),
        power=np.exp(log_share * log_power + 2 * log_stays * own_log),
    )


def _told(differs: Floats, chance: Floats, own: Floats) -> tuple[Floats, Floats, Floats]:
    """What to add to the copies' number (p,), which share of the record's chance stays, and which of their own error.

    A record has the copies' own error in its chance, as it is of the same innovations.  So that is no part of what they
    differ by, and stays.
    """
    most = np.minimum(own, MOST_OWN * chance)
    rest = np.sqrt(chance**2 - most**2)
    mean, sd = shrunk(differs / rest)
    return mean * rest, sd * rest / chance, most / np.maximum(own, _TINY)


def shrunk(e: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation (p,) of what differs, seen as e (p,) with chance of standard deviation 1.

    With kappa = 1 / (1 + tau^2) and the prior  kappa^(-1/2) (1 - kappa)^(-1/2)  of it, given kappa what differs has
    the mean (1 - kappa) e and the variance 1 - kappa.
    """
    x = np.clip(np.abs(e), 0.0, _FARTHEST)
    # kappa = sin^2 takes the prior's poles away.
    kappa = np.sin(np.pi / 2 * (np.arange(_STEPS) + 0.5) / _STEPS)[:, np.newaxis] ** 2
    weight = np.sqrt(kappa) * np.exp(-kappa * x**2 / 2)
    weight /= weight.sum(axis=0)
    expected = (weight * kappa).sum(axis=0)
    spread = (weight * kappa**2).sum(axis=0) - expected**2
    return (1 - expected) * e, np.sqrt(1 - expected + x**2 * spread)
