"""Errors of friction that a law of the temperature leaves, in groups of windows of the records.

In each group of windows, deviations of the parameters from the law are estimated.  The mean square of these deviations,
minus that of chance, is the square of the error.  The worst part of the records counts, with an upper bound, as there
are few groups.  Chance is half the mean square of the differences of neighbouring groups, as the errors of a law change
slowly.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.thermal.warm_up_search import GROUP
from monitor_core.identification.thermal.warm_up_windows import Windows

PARTS = 3
"""Number of parts of a record, which are judged separately"""
_LEAST = 3
"""Least number of groups in a part of a record; with fewer, its parts are judged as one."""
_SURE = 1.28
"""Standard deviations up to the bound that a mean square exceeds in one of ten cases."""


def deviations_in_groups(w: Windows, left: Floats, first: int = 0) -> Floats:
    """Deviations of the parameters from a law (G, p) in groups of the windows of one record.

    Args:
        w: the windows (W) of the record, with p parameters.
        left: scores (W, p) less what the law explains.
        first: the window from which on the groups are formed.
    """
    edges = np.arange(first, w.power.size + 1, GROUP)
    course = [
        np.linalg.lstsq(w.information[a:b].sum(axis=0), left[a:b].sum(axis=0), rcond=1e-12)[0]
        for a, b in pairwise(edges.tolist())
    ]
    return np.array(course).reshape(len(course), left.shape[1])


def worst_error(days: Sequence[Floats], ends: Sequence[Floats], p: int) -> Floats:
    """Standard deviation of the errors of the parameters (p,); NaN where there are too few groups.

    Args:
        days: deviations (G, p) in records, whose beginning, middle and end are judged apart.
        ends: deviations (G, p) in the last parts of records, judged together.
        p: number of parameters.
    """
    parts = [[np.array_split(course, PARTS)[k] for course in days] for k in range(PARTS)]
    few = min((len(course) for part in parts for course in part), default=0) < _LEAST
    squares = list[Floats]()
    for judged, courses in (*((part, days) for part in ([days] if few else parts)), (ends, ends)):
        n = sum(len(course) for course in judged)
        if n >= 2 * _LEAST:
            chance = (np.concatenate([np.diff(course, axis=0) for course in courses]) ** 2).mean(axis=0) / 2
            excess = (np.concatenate(judged) ** 2).mean(axis=0) - chance
            squares.append(np.maximum(excess, 0.0) + _SURE * math.sqrt(2 / n) * chance)
    if not squares:
        return np.full(p, math.nan)
    return np.asarray(np.sqrt(np.max(squares, axis=0)), np.float64)
