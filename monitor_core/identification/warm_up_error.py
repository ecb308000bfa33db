"""What a warm-up that was found in records lacks: by how much friction is off beside the heat.

One time constant and straight lines are not the law of any gearbox.  What they leave is judged on windows that the fit
has not seen:

* the beginning, the middle and the end of each record by the fit of the others, as on another day;
* the last third of each record by the fit of what was before, as of an axis that becomes warmer than its records.

In each group of windows the parameters are estimated again, beside what the fit says.  The mean square of these
deviations, less that of chance, is the square of the error; of the parts the worst one counts, with an upper bound, as
few groups tell it.  Chance is half the mean square of the difference of neighbouring groups, as what the heat lacks
changes slowly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.thermal_state import ThermalStart
from monitor_core.identification.warm_up_search import GROUP, Search, WarmUpFit, Windows, left_of

_PARTS = 3
"""Of a record: they are judged apart, and by the first ones the last."""
_LEAST = 3
"""Groups in a part of a record; with fewer of them its parts are judged as one."""
_SURE = 1.28
"""Standard deviations up to the bound that a mean square exceeds in one of ten cases."""


def model_errors(
    windows: Sequence[Windows], index: list[int], carried: Sequence[float | None], start: ThermalStart
) -> Floats:
    """Standard deviation of what the parameters (p,) are off by beside the heat, in their units.

    NaN where the records are too short to tell.

    Args:
        windows: of each record, with p parameters.
        index: parameters that follow the heat.
        carried: pause before each record that follows the one before it [s].
        start: how the first record begins.
    """
    days = [
        course
        for seen in _days(windows, carried, start)
        for course in _deviations(windows, seen, index, carried, start)
    ]
    but_last = [np.arange(w.power.size) < w.power.size * (_PARTS - 1) / _PARTS for w in windows]
    ends = _deviations(windows, but_last, index, carried, start)
    parts = [[np.array_split(course, _PARTS)[k] for course in days] for k in range(_PARTS)]
    few = min((len(course) for part in parts for course in part), default=0) < _LEAST
    squares = list[Floats]()
    for judged, courses in (*((part, days) for part in ([days] if few else parts)), (ends, ends)):
        n = sum(len(course) for course in judged)
        if n >= 2 * _LEAST:
            chance = (np.concatenate([np.diff(course, axis=0) for course in courses]) ** 2).mean(axis=0) / 2
            excess = (np.concatenate(judged) ** 2).mean(axis=0) - chance
            squares.append(np.maximum(excess, 0.0) + _SURE * math.sqrt(2 / n) * chance)
    if not squares:
        return np.full(windows[0].score.shape[1], math.nan)
    return np.asarray(np.sqrt(np.max(squares, axis=0)), np.float64)


def _days(
    windows: Sequence[Windows], carried: Sequence[float | None], start: ThermalStart
) -> Iterator[list[Bools]]:
    """Which windows (W,) of each record the fit sees: all but those of one record.

    The fit needs a record that begins at a known heat, if there is one.
    """
    known = [start == "cold"]
    for pause in carried[1:]:
        known.append(pause is not None and known[-1])
    for k in range(len(windows) if len(windows) > 1 else 0):
        if any(known[:k] + known[k + 1 :]) or not any(known):
            yield [np.full(w.power.size, j != k) for j, w in enumerate(windows)]


def _deviations(
    windows: Sequence[Windows],
    seen: Sequence[Bools],
    index: list[int],
    carried: Sequence[float | None],
    start: ThermalStart,
) -> list[Floats]:
    """Deviations of the parameters (G, p) in the groups of windows of each record that the fit does not see."""
    masked = [
        w._replace(
            information=w.information * by[:, np.newaxis, np.newaxis], score=w.score * by[:, np.newaxis]
        )
        for w, by in zip(windows, seen, strict=True)
    ]
    search = Search(masked, index, carried, start)
    fit, found = search.best(index), list[Floats]()
    for k, (w, by, left) in enumerate(zip(windows, seen, left_of(windows, fit), strict=True)):
        if by.all():
            continue
        if not by.any() and k in search.free:
            left = _from_best_start(w, fit, left)
        edges = np.arange(int(np.argmin(by)), w.power.size + 1, GROUP)
        course = [
            np.linalg.lstsq(w.information[a:b].sum(axis=0), left[a:b].sum(axis=0), rcond=1e-12)[0]
            for a, b in pairwise(edges.tolist())
        ]
        found.append(np.array(course).reshape(len(course), w.score.shape[1]))
    return found


def _from_best_start(w: Windows, fit: WarmUpFit, left: Floats) -> Floats:
    """Scores (W, p) that are left when the heat at the start, which the fit has not seen, is the likeliest one."""
    kept, slopes = np.exp(-w.middle_s / fit.tau_s), np.zeros(left.shape[1])
    slopes[fit.which] = fit.slopes
    course = np.einsum("wij,j,w->wi", w.information, slopes, kept)
    weight = float(kept @ course @ slopes)
    more = float(kept @ left @ slopes) / weight if weight > 0 else 0.0
    return np.asarray(left - more * course)
