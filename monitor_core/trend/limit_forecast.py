"""Forecast: when a parameter reaches a limit, with an interval; or since when it has been beyond.

The trends that fit the history are extrapolated: the limit has been passed by a time t with the probability F(t), the
sum over all trends of that of a Gaussian (for each single trend this is Fieller's interval).  The interval ends where F
is 5 and 95 %; where F does not reach these values the interval is open, or no time is in sight.
"""

from typing import Literal, NamedTuple

import numpy as np
from scipy.special import ndtr

from monitor_core.arrays import Floats
from monitor_core.trend.trend import Mixture, Trend

COVERED = 0.9
"""Probability of every interval."""

FARTHEST = 10.0
"""Times the span of the history: no forecast reaches farther."""

_STEPS = 400

State = Literal["ahead", "open", "far", "beyond"]
"""ahead: it will be reached in the interval; open: not before its lower end, perhaps never; far: not in sight, and not
before that end; beyond: it has been reached, in the interval."""


class Forecast(NamedTuple):
    """When a limit is reached, with probability COVERED; microseconds since 1970."""

    state: State
    low_us: int
    high_us: int | None


def forecast(trend: Trend, limit: float, upper: bool) -> Forecast:
    """When the trend of a parameter reaches a limit, in its unit; ``upper``: it must stay below."""
    m, sign = trend.mixture, 1.0 if upper else -1.0
    beyond = float(_passed(m, np.array([m.end]), limit, sign)[0])
    if beyond >= (1 + COVERED) / 2:
        since, until = _since(m, limit, sign)
        return Forecast("beyond", _us(m, since), _us(m, until))
    t = m.end + (m.end - m.begin) * np.concatenate([[0.0], np.geomspace(1e-4, FARTHEST, _STEPS)])
    F = np.maximum.accumulate(_passed(m, t, limit, sign))
    low, high = _reached(t, F, (1 - COVERED) / 2), _reached(t, F, (1 + COVERED) / 2)
    if low is None:
        return Forecast("far", _us(m, float(t[-1])), None)
    if high is None:
        return Forecast("open", _us(m, low), None)
    return Forecast("ahead", _us(m, low), _us(m, high))


def _passed(m: Mixture, t: Floats, limit: float, sign: float) -> Floats:
    """Probability of being beyond the limit at each time (T,)."""
    mean, sd = m.at_times(t)
    return np.asarray(ndtr(sign * (mean - limit) / sd) @ m.p)


def _reached(t: Floats, F: Floats, p: float) -> float | None:
    """First time at which F is p, interpolated linearly on the grid."""
    if p > F[-1]:
        return None
    k = int(np.searchsorted(F, p))
    if k == 0:
        return float(t[0])
    return float(t[k - 1] + (t[k] - t[k - 1]) * (p - F[k - 1]) / (F[k] - F[k - 1]))


def _since(m: Mixture, limit: float, sign: float) -> tuple[float, float]:
    """The last times at which it was not beyond, with 95 and with 5 %, looking back."""
    t = np.linspace(m.end, m.begin, _STEPS)
    F = np.minimum.accumulate(_passed(m, t, limit, sign))
    ends = []
    for least in ((1 - COVERED) / 2, (1 + COVERED) / 2):
        below = np.flatnonzero(least > F)
        ends.append(float(t[below[0]]) if len(below) else m.begin)
    return ends[0], ends[1]


def _us(m: Mixture, t: float) -> int:
    return m.zero_us + round(t * 1e6)
