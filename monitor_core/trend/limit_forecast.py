"""Forecast of the time at which a parameter reaches a limit, with an interval; or since when it is beyond the limit.

The trends that fit the history are extrapolated.  F(t) is the probability that the limit has been passed by the time t:
the weighted sum over all trends of a Gaussian probability (for a single trend this is Fieller's interval).  The ends of
the interval are the times at which F is 5 and 95 %.  If F does not reach these values, the interval is open, or no time
can be given.
"""

from typing import Literal, NamedTuple

import numpy as np
from scipy.special import ndtr

from monitor_core.arrays import Floats
from monitor_core.trend.trend import Mixture, Trend

COVERED = 0.9
"""Probability of every interval."""

FARTHEST = 10.0
"""Longest forecast, as a multiple of the span of the history."""

_STEPS = 400

ForecastState = Literal["ahead", "open", "far", "beyond"]
"""ahead: the limit will be reached within the interval; open: it will not be reached before ``low_us``, perhaps never;
far: it will not be reached before ``low_us``, the end of the forecast; beyond: it was reached within the interval."""


class Forecast(NamedTuple):
    """Interval in which a limit is reached, with probability COVERED; microseconds since 1970."""

    state: ForecastState
    low_us: int
    high_us: int | None


def forecast(trend: Trend, limit: float, upper: bool) -> Forecast:
    """Forecast for a limit in the unit of the parameter; ``upper``: the parameter must stay below the limit."""
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
    """Interval of the time since which the parameter is beyond the limit: where F was last below 5 and below 95 %."""
    t = np.linspace(m.end, m.begin, _STEPS)
    F = np.minimum.accumulate(_passed(m, t, limit, sign))
    ends = []
    for least in ((1 - COVERED) / 2, (1 + COVERED) / 2):
        below = np.flatnonzero(least > F)
        ends.append(float(t[below[0]]) if len(below) else m.begin)
    return ends[0], ends[1]


def _us(m: Mixture, t: float) -> int:
    return m.zero_us + round(t * 1e6)
