"""Thresholds of a bank from a healthy record, for a mean time between false alarms.

For an exact model g exceeds h about exp(-h) as often as it leaves zero.  Of a real axis it is about exp(-r h), with an
r of each hypothesis that the record has to tell: what the model lacks looks a little like some of the faults.
"""

import numpy as np

from monitor_core.kernel.tables import Floats

LEAST_HEIGHT = 2.0
"""Excursions of g below that are not counted: their heights do not tell the tail."""
ALIKE = 10
"""So many excursions as an exact model would have are added to those of the record."""
BLOCKS = 8


def thresholds(g: Floats, interval_s: float, mean_time_s: float) -> Floats:
    """h (H,) for one false alarm of the whole bank in ``mean_time_s``, from g (N, H) of a healthy record.

    The heights of the excursions of g above LEAST_HEIGHT have an exponential tail,  rate(h) = rate exp(-r (h - LEAST));
    all hypotheses alarm equally seldom.

    Raises:
        ValueError: a record or a time that is not longer than an interval.
    """
    N, H = g.shape
    duration_s = N * interval_s
    if not (duration_s > interval_s and mean_time_s > interval_s):
        raise ValueError(
            f"a record of {duration_s} s for {mean_time_s} s: both must be longer than an interval"
        )
    found = [excursions(g[:, i]) for i in range(H)]
    heights = [of[of > LEAST_HEIGHT] - LEAST_HEIGHT for of in found]
    number = np.array([len(of) for of in heights], float)
    r = (number + ALIKE) / (np.array([of.sum() for of in heights]) + ALIKE)
    often = np.maximum(number, 1.0) * H * mean_time_s / duration_s
    return np.asarray(LEAST_HEIGHT + np.log(np.maximum(often, 1.0)) / np.minimum(r, 1.0))


def excursions(g: Floats) -> Floats:
    """Largest g (k,) between each two zeros of g (N,)."""
    away = np.concatenate([[False], g > 0, [False]])
    begins, ends = np.flatnonzero(~away[:-1] & away[1:]), np.flatnonzero(away[:-1] & ~away[1:])
    return np.array([g[a:b].max() for a, b in zip(begins, ends, strict=True)])


def allowances(llr: Floats) -> Floats:
    """What is to be taken from each log-likelihood ratio (H,), so that in no part of a healthy record it is positive.

    ``llr`` (N, H), NaN where nothing was tested; the record is looked at in BLOCKS parts.
    """
    tested = llr[np.isfinite(llr).any(axis=1)]
    finite = np.where(np.isfinite(tested), tested, 0.0)
    means = np.array([part.mean(axis=0) for part in np.array_split(finite, BLOCKS) if len(part)])
    return np.asarray(np.maximum(0.0, 2 * means.max(axis=0, initial=0.0)))
