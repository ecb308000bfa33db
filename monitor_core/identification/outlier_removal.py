"""Removal of outliers in the innovations form: K carries each of them on in the state, whatever the loss."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.criterion import HUBER, Progress, settled, solve
from monitor_core.identification.levenberg_marquardt import End
from monitor_core.identification.predictor import Predictor
from monitor_core.identification.record import Bools, Record

GROSS = 5.0
"""Standard deviations: of normal errors one in 1.7 million is beyond."""

_CARRIED = 20
"""Samples that an outlier may disturb: gross errors this close behind one are looked at again without it."""

_LOOKS = 20
"""At the last of them all that is gross counts: a stretch in which nothing fits is not taken apart any further."""


class Fitted(NamedTuple):
    """Result of ``solve``, and the number of outputs of each record that count as not measured."""

    predictor: Predictor
    end: End
    limit: float
    outliers: tuple[int, ...] = ()


def without_gross(
    predictor: Predictor, end: End, limit: float, most: int, progress: Progress | None
) -> Fitted:
    """Repeat a fit with Huber's loss without the outputs whose errors are gross.

    Only with a gain: in a simulation an outlier affects only its own error, which is clipped.
    """
    same = Fitted(predictor, end, limit)
    if not (limit < np.inf and predictor.gain(end.xi).K.any()):
        return same
    gross = outliers(predictor, end.xi, GROSS / HUBER * limit)
    if not any(which.any() for which in gross):
        return same
    records = _without(predictor, gross)
    try:
        again, found, limit = solve(settled(predictor, end.xi), records, most, progress)
    except ValueError:  # a value at its bound may start beyond it by rounding
        return same
    found = found._replace(evaluations=end.evaluations + found.evaluations)
    return Fitted(again, found, limit, tuple(int(np.count_nonzero(which)) for which in gross))


def outliers(predictor: Predictor, xi: Floats, limit: float) -> list[Bools]:
    """Outputs (N,) of each record that are beyond the limit themselves, not because K carried other errors on.

    Of gross errors in close succession the first counts, then the errors are computed without it.
    """
    found = [np.zeros(len(s.record), dtype=np.bool_) for s in predictor.series]
    looking = predictor
    for look in range(_LOOKS):
        gross = [np.abs(e.eps) > limit for e in looking.errors(xi)]
        if not any(which.any() for which in gross):
            break
        last = look == _LOOKS - 1
        found = [have | (new if last else _first(new)) for have, new in zip(found, gross, strict=True)]
        looking = Predictor(predictor.problem, _without(predictor, found), predictor.disturbance)
    return found


def _first(gross: Bools) -> Bools:
    """Those with no other shortly before."""
    before = np.cumsum(np.concatenate([np.zeros(_CARRIED + 1, dtype=np.int64), gross]))
    return np.asarray(gross & (before[_CARRIED:-1] == before[: -_CARRIED - 1]))


def _without(predictor: Predictor, which: Sequence[Bools]) -> list[Record]:
    return [s.record.without(these) for s, these in zip(predictor.series, which, strict=True)]
