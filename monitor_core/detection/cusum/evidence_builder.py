"""Evidence for the cause of a change, and readings for the long-term trend, from what the kernel has noted."""

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection.cusum.cusum_events import Evidence
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


class EvidenceBuilder:
    """Evidence of one axis.

    Args:
        model: of the axis.
        settings: of the axis.
        lower: bounds of theta (p,).
        upper: (p,).
        P_nom: diagonal of P(0) (p,), as it is when there is evidence.
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
        """Column c of what was noted, for the slow course."""
        s, p, value = self._s, len(self._names), noted.value[:, c]
        theta, d, P = value[1 : 1 + p], value[1 + p : 1 + 2 * p], value[1 + 2 * p :][: p * p]
        known = (value[-p:] != UNSEEN) & (self._held(theta, theta - d) == 0) & (value[0] <= INVALID * s.lam0)
        return Reading(
            time_us=int(noted.what[2, c]),
            value=tuple(map(float, self._theta0 + d)),
            variance=tuple(map(float, s.lam0 * P[:: p + 1] / s.divisor)),
            known=tuple(map(bool, known)),
            span_s=self._naming * s.interval_s,
            correlation=s.lam**self._naming,
        )

    def evidence(self, noted: EvidenceColumns, c: int) -> Evidence:
        """Column c of what was noted."""
        s, p, value = self._s, len(self._names), noted.value[:, c]
        theta, d, P = value[1 : 1 + p], value[1 + p : 1 + 2 * p], value[1 + 2 * p :][: p * p].reshape(p, p)
        V = s.lam0 * P / s.divisor
        held = tuple(int(way) for way in self._held(theta, theta - d))
        past = self._past(noted, c)
        found = lately(past, SINCE)
        since, since_V = (d, V) if found is None else found
        return Evidence(
            time_us=int(noted.what[2, c]),
            parameters=self._names,
            deviation=tuple(map(float, d)),
            covariance=_rows(V + self._allowed),
            since=tuple(map(float, since)),
            since_covariance=_rows(since_V + self._allowed),
            tolerance=self._tolerance,
            excess=float(value[0]) / s.lam0,
            held=held,
            past=past,
        )

    def _past(self, noted: EvidenceColumns, c: int) -> Past:
        s, p = self._s, len(self._names)
        lam = 1.0 if s.random_walk else s.lam**s.span
        walk = s.span * (1 - s.lam) * self._P_nom if s.random_walk else np.zeros(p)
        return past_of(noted.t[c], noted.before[c], p, lam, walk, s.lam0, self._lag_us)

    def _held(self, theta: Floats, nominal: Floats) -> Floats:
        """-1, 1 where the lower, the upper bound holds theta (p,)."""
        lower, upper = self._bounds
        down = np.abs(theta - lower) <= HELD * np.abs(nominal - lower)
        up = np.abs(theta - upper) <= HELD * np.abs(nominal - upper)
        return np.where(down, -1.0, np.where(up, 1.0, 0.0))


def _rows(V: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, row)) for row in V)
