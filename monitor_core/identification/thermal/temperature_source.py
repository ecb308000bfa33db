"""Whether a measured temperature is of the axis: that follows what the motion turns into heat, also in its breaks.

A cabinet or a hall becomes warmer in the morning, too, whatever the axis does.  So the course of the temperature is
explained twice: by a body that the friction and the current of the motor heat, and by the same body with a constant
heat in their place.  Each has a time constant, a thermometer that lags behind it, and, where the record does not begin
cold, a heat at its start.  While the axis always works alike both explain the same.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from monitor_core.arrays import Floats
from monitor_core.drive.friction_roles import braking
from monitor_core.drive.thermal_state import TEMPERATURE, ThermalModel
from monitor_core.identification.greybox import Estimate
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal.warm_up_search import heat_course
from monitor_core.identification.thermal.warm_up_windows import WINDOW_S, speeds_of

_TIMES = 12
"""Number of time constants that are tried"""
_SHORTEST_S, _LONGEST = 60.0, 2.0
"""The shortest one, and the longest in lengths of the records"""
_CLEARLY = 2.0
"""How many times larger the squared errors of the wrong explanation are where the records tell"""


class TemperatureCourse(NamedTuple):
    """The windows (W) of one record."""

    temperature: Floats  # (W,)
    heating: Floats  # (W, 2) friction power [W] and squared torque [N^2 m^2]


def temperature_courses(found: Estimate, records: Sequence[Record]) -> list[TemperatureCourse]:
    """The courses of the signal "temperature", with the friction of a fit."""
    fm, fc = braking(found.drive, found.values)
    friction, courses = ThermalModel(1.0, fm, fc, 1.0), list[TemperatureCourse]()
    for record in records:
        since = record.t - record.t[0]
        speed, h = speeds_of(record)
        which = (since // WINDOW_S).astype(np.int64)
        count = int(which[-1]) + 1
        heating = [np.bincount(which, power * h, count) / WINDOW_S for power in (friction.power(speed), record.u**2)]
        shown = np.interp((np.arange(count) + 0.5) * WINDOW_S, since, record.signals[TEMPERATURE])
        courses.append(TemperatureCourse(np.asarray(shown, np.float64), np.column_stack(heating)))
    return courses


def follows_motion(courses: Sequence[TemperatureCourse], begins_cold: bool) -> bool | None:
    """Whether the temperature in these records follows the motion; None: they do not tell.

    ``begins_cold``: whether the first one begins cold; the others may begin with any heat.
    """
    by_motion = _left(courses, [course.heating for course in courses], begins_cold)
    by_time = _left(courses, [np.ones((len(course.temperature), 1)) for course in courses], begins_cold)
    if max(by_motion, by_time) < _CLEARLY * min(by_motion, by_time):
        return None
    return by_motion < by_time


def _left(courses: Sequence[TemperatureCourse], heating: Sequence[Floats], begins_cold: bool) -> float:
    """The least squared errors of the temperature that such a heating leaves, over the time constants."""
    shown = np.concatenate([course.temperature - course.temperature.mean() for course in courses])
    longest_s = _LONGEST * WINDOW_S * max(len(course.temperature) for course in courses)
    times_s = np.geomspace(_SHORTEST_S, max(longest_s, _SHORTEST_S), _TIMES).tolist()
    best = float(shown @ shown)
    for k, tau_s in enumerate(times_s):
        for lag_s in (None, *times_s[: k + 1 : 2]):
            warmths = _warmths(heating, begins_cold, tau_s, lag_s)
            size = np.sqrt(np.maximum((warmths**2).sum(axis=0), 1e-300))
            best = min(best, float(nnls(warmths / size, shown)[1]) ** 2)
    return best


def _warmths(heating: Sequence[Floats], begins_cold: bool, tau_s: float, lag_s: float | None) -> Floats:
    """Courses of the temperature about their means in each record, of which no share is negative.

    Returns:
        (W of all records, columns): one for each heating from a cold start, and for each record that need not begin
        cold one with a heat at its start.
    """
    first_free = int(begins_cold)
    rows = list[Floats]()
    for k, heats in enumerate(heating):
        courses = [_shown(column, 0.0, tau_s, lag_s) for column in heats.T]
        starts = np.zeros((len(heats), len(heating) - first_free))
        if k >= first_free:
            starts[:, k - first_free] = _shown(np.zeros(len(heats)), 1.0, tau_s, lag_s)
        found = np.column_stack([*courses, starts])
        rows.append(found - found.mean(axis=0))
    return np.concatenate(rows)


def _shown(heating: Floats, start: float, tau_s: float, lag_s: float | None) -> Floats:
    """What a thermometer shows of a body with this heating and a heat at the start."""
    course, _ = heat_course(heating, start, tau_s)
    return course if lag_s is None else heat_course(course, start, lag_s)[0]
