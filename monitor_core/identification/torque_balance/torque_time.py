"""Finds how much later the torque of a sample is than one that acts from the sample on, in halves of a sample.

The predictor holds the torque of a sample until the next one.  That is right for a controller that sets a torque at
each sample.  But most drives change their torque many times between the samples of a record.  It then has the torque at
the sample, and the one that acts is the mean of this and the next one.  Held instead, it looks like viscous friction
of h / 2 times the inertia times mean(acceleration^2) / mean(speed^2): at 12 ms, that may be half of the friction of an
arm.
``samples_late`` finds larger delays.

The torque that one mass does not explain has the least sum of squares if the torque is shifted by the right time.  Near
it, the sum is a parabola.  Its vertex follows from shifts by whole samples, on which the noise of the torque has the
same effect.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import (
    POSE,
    USUAL,
    GridPart,
    TorqueTerm,
    least_speed,
    moving_windows,
    residual_torque,
    windowed_equations,
    windowed_parts,
)

_WINDOWS_S = (0.4, 0.6, 0.9)
"""Lengths of the windows.  In shorter ones the arm does not yet follow the motor."""
_MANY_TERMS: tuple[TorqueTerm, ...] = (*POSE, "stribeck", "drag")
"""A second model of the torque.  The scatter of the time over both models, and over the windows, is part of its
uncertainty: what no model explains is hardly random, so longer records do not make it smaller."""
_SHORTEST = 24
"""Least number of samples in a window, so that sums equal integrals to 1e-3."""
_FEWEST = 200
"""Least number of equations."""
_BLOCKS = 20
"""Parts of the records; each is left out once (jackknife)."""
_LATEST = 2
"""Largest shift around which the parabola is taken: it is one only near its vertex."""
_OTHER = 2.0
"""An axis has another time than the rest of its robot if both differ by more than this many standard deviations."""
_HALF = 0.5
"""The time is given in halves of a sample."""
_LONGEST_HELD_S = 0.005
"""Longest interval at which a controller sets the torque itself [s]; at longer ones, a drive controls it in between."""


class TorqueTime(NamedTuple):
    """How much later the torque is than one that acts from its sample on, in samples, with its standard deviation."""

    late: float
    sd: float

    def halves(self, interval_s: float) -> float:
        """Multiple of half a sample by which to take a later torque; 0: it acts from the sample on, as far as is known.

        ``interval_s``: between the samples.  No drive holds its torque for longer than ``_LONGEST_HELD_S``: then half a
        sample needs no evidence, but evidence against it.  More is taken only as far as it is sure: what an arm lacks
        to be rigid may look like some of it.
        """
        usual = 0.0 if interval_s <= _LONGEST_HELD_S else _HALF
        if not self.is_known:
            return usual
        least, most = self.late - self.sd, self.late + self.sd
        held = most < _HALF / 2 if usual else least <= _HALF / 2
        return 0.0 if held else max(round(least / _HALF) * _HALF, _HALF)

    @property
    def is_known(self) -> bool:
        """Whether it is known to half a sample: where an arm rings, windows of other lengths show other times."""
        return self.sd <= _HALF


def torque_time(records: Sequence[Record]) -> TorqueTime | None:
    """The time of the torque in the records of an axis; None: they are too short, or show none."""
    parts, scale = windowed_parts(records), speed_scales(records)[0]
    if not scale > 0:
        return None
    least, h = least_speed(parts) or 0.0, float(np.median([part.h for part in parts]))
    lengths = list(dict.fromkeys(max(_SHORTEST, round(seconds / h)) for seconds in _WINDOWS_S))

    def times(terms: Sequence[TorqueTerm], lengths: Sequence[int]) -> list[TorqueTime]:
        return [time for length in lengths if (time := _in_windows(parts, length, scale, least, terms))]

    few = times(USUAL, lengths)
    if len(few) < len(lengths):
        return None
    both = [*few, *times(_MANY_TERMS, lengths[:-1])]  # the longest windows tell little of many terms
    best = min(both, key=lambda time: time.sd)
    scatter = max(abs(time.late - best.late) for time in both)
    return TorqueTime(best.late, math.hypot(best.sd, scatter / 2))


def times_of_robot(times: Mapping[str, TorqueTime | None]) -> dict[str, TorqueTime]:
    """The time of each axis, by name, given those of all axes of its robot, whose torques are mostly sent alike.

    An axis whose time is known, and differs from the mean of the others, keeps its own; the rest has their mean.
    Empty: no axis shows it.
    """
    known = {name: time for name, time in times.items() if time is not None}
    apart = {
        name: own
        for name, own in known.items()
        if own.is_known
        and (others := [time for other, time in known.items() if other != name])
        and _differ(own, _mean(others))
    }
    alike = [time for name, time in known.items() if name not in apart]
    return {name: apart[name] if name in apart else _mean(alike) for name in times if name in apart or alike}


def _differ(own: TorqueTime, others: TorqueTime) -> bool:
    return abs(own.late - others.late) > _OTHER * math.hypot(own.sd, others.sd)


def _mean(times: Sequence[TorqueTime]) -> TorqueTime:
    """The weighted mean; less certain where the scatter is beyond the standard deviations (Birge, 1932)."""
    late, sd = (np.array(values) for values in zip(*times, strict=True))
    weights = sd**-2.0
    mean, variance = float(weights @ late / weights.sum()), float(1 / weights.sum())
    scatter = float(weights @ (late - mean) ** 2) / max(len(times) - 1, 1)
    return TorqueTime(mean, math.sqrt(variance * max(scatter, 1.0)))


def _in_windows(
    parts: Sequence[GridPart], window: int, scale: float, least: float, terms: Sequence[TorqueTerm]
) -> TorqueTime | None:
    """The vertex with its standard deviation from windows of this length; None: too few windows, or no vertex."""
    shifts = range(-1, _LATEST + 2)
    left = [unexplained_changes([_shifted(part, k) for part in parts], window, scale, least, terms) for k in shifts]
    if left[0].size < _FEWEST:
        return None
    sums = np.stack([[np.sum(block**2) for block in np.array_split(each, _BLOCKS)] for each in left])
    every = sums.sum(axis=1)
    nearest = int(every[1:-1].argmin())
    around = slice(nearest, nearest + 3)
    late, others = _vertex(every[around]), _vertex((every[:, np.newaxis] - sums)[around])
    if not (np.isfinite(others).all() and np.isfinite(late)):
        return None
    variance = (_BLOCKS - 1) * float(np.mean((others - others.mean()) ** 2))
    return TorqueTime(nearest + float(late), math.sqrt(variance))


def _vertex(sums: Floats) -> Floats:
    """Place of the least value of parabolas through values (3, ..) at -1, 0, 1; NaN: they have none."""
    before, middle, after = sums
    bend = before - 2 * middle + after
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(bend > 0, (before - after) / (2 * bend), np.nan))


def _shifted(part: GridPart, samples: int) -> GridPart:
    """The part with the torque so many samples later, without the ends at which some shift has none."""
    last = len(part.u) - _LATEST - 1
    return part._replace(u=part.u[1 + samples : last + samples], y=part.y[1:last], signals={})


def unexplained_changes(
    parts: Sequence[GridPart], window: int, scale: float, least: float, terms: Sequence[TorqueTerm] = USUAL
) -> Floats:
    """Changes of the torque (M,) from window to window that a rigid mass with these terms does not explain.

    Of the changes: what depends on the pose changes slowly.
    """
    rows, torque = [np.zeros((0, 1 + len(terms)))], [np.zeros(0)]
    for part in parts:
        if len(part.u) > window:
            columns, right = windowed_equations(part, window, scale, terms)
            moves = moving_windows(part, window, least)
            both = moves[1:] & moves[:-1]
            rows.append(np.diff(columns, axis=0)[both])
            torque.append(np.diff(right)[both])
    return residual_torque(np.concatenate(rows), np.concatenate(torque))
