"""What the CUSUM tests of an axis report: crossings of h, recoveries, and the evidence to name a cause.

The kernel notes the estimates when there is a cause to be named, or a reading of the long-term trend is due;
``EvidenceBuilder`` makes evidence and readings of the columns that it has noted.
"""

from dataclasses import dataclass, field

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.alarm import Direction
from monitor_core.detection.onset import Past, lately, past_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.kernel.evidence import EvidenceColumns
from monitor_core.kernel.state import UNSEEN
from monitor_core.settings import Settings
from monitor_core.trend.entries import Reading

SINCE = 12
"""Quarters of a memory from the first crossing to the evidence."""

INVALID = 100.0
"""Running innovation variance over lambda_0: with errors ten times as large as they were the model does not hold."""

HELD = 0.1
"""Of the way from the nominal value to a bound: an estimate that is held scatters by so much."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """g of a parameter has crossed h.  Times in microseconds since 1970."""

    parameter: str
    direction: Direction
    time_us: int
    onset_us: int
    size: float
    size_sd: float


@dataclass(frozen=True, slots=True)
class Recovered:
    """The deviation of a parameter has stayed below nu for three memory lengths."""

    parameter: str
    time_us: int


@dataclass(frozen=True, slots=True)
class Evidence:
    """Deviations of all parameters at one time, with their covariance."""

    time_us: int
    parameters: tuple[str, ...]
    deviation: tuple[float, ...]
    """theta - theta_0 now: for the sizes"""
    covariance: tuple[tuple[float, ...], ...]
    since: tuple[float, ...]
    """The deviations that explain the samples of the last three memory lengths, all with equal weight: for the
    isolation of causes.  The estimates forget, and may hold little information at this moment."""
    since_covariance: tuple[tuple[float, ...], ...]
    tolerance: float
    """Standard deviations by which the estimate of a healthy axis may be off"""
    excess: float
    """Running innovation variance over lambda_0"""
    held: tuple[int, ...]
    """-1, 1: the estimate is at its lower, upper bound; 0: at neither"""
    past: Past | None = field(default=None, compare=False)
    """Earlier deviations; None: not known, and no cause is named"""


CusumEvent = Crossing | Recovered | Evidence
BatchEvent = CusumEvent | Reading
"""Of an axis batch: readings for the long-term trend come with them."""


class EvidenceBuilder:
    """Evidence of one axis.

    ``lower`` and ``upper`` (p,) are the bounds of theta, ``P_nom`` (p,) the diagonal of P(0): views, read when there is
    evidence.
    """

    def __init__(
        self, model: AxisModel, settings: Settings, lower: Floats, upper: Floats, P_nom: Floats
    ) -> None:
        self._names, self._s, self._bounds, self._P_nom = model.monitored, settings, (lower, upper), P_nom
        self._theta0, self._naming = model.theta0, settings.naming_samples
        alpha1, _, allowance = settings.tests(len(self._names))
        self._tolerance = float(alpha1.max() * np.sqrt(settings.divisor))
        self._allowed = np.diag((allowance * model.scale) ** 2)
        K = settings.gain(len(model.drive.states))
        lag_s = slowest_time_constant(model, K, settings.interval_s)
        self._lag_us = 1e6 * min(lag_s, 3 * settings.memory * settings.interval_s)

    def reading(self, noted: EvidenceColumns, c: int) -> Reading:
        """Column c of what was noted, for the long-term trend."""
        s = self._s
        running, theta, d, P = self._column(noted, c)
        unseen = noted.value[-len(self._names) :, c] == UNSEEN
        known = ~unseen & (self._held(theta, theta - d) == 0) & (running <= INVALID * s.lam0)
        return Reading(
            time_us=int(noted.what[2, c]),
            value=_numbers(self._theta0 + d),
            variance=_numbers(s.lam0 * np.diag(P) / s.divisor),
            known=tuple(map(bool, known)),
            span_s=self._naming * s.interval_s,
            correlation=s.lam**self._naming,
        )

    def evidence(self, noted: EvidenceColumns, c: int) -> Evidence:
        """Column c of what was noted."""
        s, p = self._s, len(self._names)
        running, theta, d, P = self._column(noted, c)
        V = s.lam0 * P / s.divisor
        lam = 1.0 if s.random_walk else s.lam**s.span
        walk = s.span * (1 - s.lam) * self._P_nom if s.random_walk else np.zeros(p)
        past = past_of(noted.t[c], noted.before[c], p, lam, walk, s.lam0, self._lag_us)
        since, since_V = lately(past, SINCE) or (d, V)
        return Evidence(
            time_us=int(noted.what[2, c]),
            parameters=self._names,
            deviation=_numbers(d),
            covariance=tuple(map(_numbers, V + self._allowed)),
            since=_numbers(since),
            since_covariance=tuple(map(_numbers, since_V + self._allowed)),
            tolerance=self._tolerance,
            excess=running / s.lam0,
            held=tuple(map(int, self._held(theta, theta - d))),
            past=past,
        )

    def _column(self, noted: EvidenceColumns, c: int) -> tuple[float, Floats, Floats, Floats]:
        """Running innovation variance, theta (p,), its deviation (p,), and P (p, p)."""
        value, p = noted.value[:, c], len(self._names)
        running, theta, d, P, _ = np.split(value, np.cumsum([1, p, p, p * p]))
        return float(running[0]), theta, d, P.reshape(p, p)

    def _held(self, theta: Floats, nominal: Floats) -> Floats:
        """-1, 1 where the lower, the upper bound holds theta (p,)."""
        lower, upper = self._bounds
        down = np.abs(theta - lower) <= HELD * np.abs(nominal - lower)
        up = np.abs(theta - upper) <= HELD * np.abs(nominal - upper)
        return np.where(down, -1.0, np.where(up, 1.0, 0.0))


def _numbers(values: Floats) -> tuple[float, ...]:
    return tuple(map(float, values))
