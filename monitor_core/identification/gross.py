"""Outliers in the innovations form: K carries each on in the state, whatever the loss makes of its own error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monitor_core.identification.descent import End
from monitor_core.identification.fit import HUBER, Progress, settled, solve
from monitor_core.identification.predictor import Predictor

GROSS = 5.0
"""Standard deviations: of normal errors one in 1.7 million is beyond."""


class Fitted(NamedTuple):
    """As ``solve`` returns it; how many outputs of each record count as not measured."""

    predictor: Predictor
    end: End
    limit: float
    outliers: tuple[int, ...] = ()


def without_gross(
    predictor: Predictor, end: End, limit: float, most: int, progress: Progress | None
) -> Fitted:
    """A fit with Huber's loss once more, without the outputs whose errors are gross.

    Only where there is a gain: in a simulation an outlier is nothing but its own error, which is clipped.
    """
    same = Fitted(predictor, end, limit)
    if not (limit < np.inf and predictor.gain(end.xi).K.any()):
        return same
    gross = [np.abs(e.eps) > GROSS / HUBER * limit for e in predictor.errors(end.xi)]
    if not np.any(np.concatenate(gross)):
        return same
    records = [s.record.without(which) for s, which in zip(predictor.series, gross, strict=True)]
    try:
        again, found, limit = solve(settled(predictor, end.xi), records, most, progress)
    except ValueError:  # a value that ended at its bound may start beyond it by its last digit
        return same
    found = found._replace(evaluations=end.evaluations + found.evaluations)
    return Fitted(again, found, limit, tuple(int(np.count_nonzero(which)) for which in gross))
