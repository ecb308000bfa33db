"""What the CUSUM tests of an axis report: crossings of h, and evidence of what the parameters are since then.

The kernel notes the estimates three memory lengths after a crossing, and every three memory lengths.
``EvidenceBuilder`` makes evidence, and readings of the long-term trend, of the columns that it has noted.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.detection.alarm import TORQUE_CONSTANT, Direction
from monitor_core.detection.onset import Past, lately, past_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.drive.structure import LOAD
from monitor_core.kernel.evidence import KEPT, EvidenceColumns
from monitor_core.kernel.state import UNSEEN
from monitor_core.settings import Settings
from monitor_core.trend.entries import Reading

INVALID = 100.0
"""Running innovation variance over lambda_0: with errors ten times as large as they were the model does not hold."""

HELD = 0.1
"""Of the distance from the nominal value to a bound: an estimate that is held there scatters by so much."""
BELOW_ZERO = 2.0
"""Standard deviations by which friction or damping is below zero, which none can be: something else drives the axis."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """g of a parameter has crossed h.  Times in microseconds since 1970."""

    parameter: str
    direction: Direction
    time_us: int
    onset_us: int


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Deviations of all parameters up to one time."""

    time_us: int
    parameters: tuple[str, ...]
    deviation: Floats
    """theta - theta_0 (p,) at that time"""
    covariance: Floats
    """Its covariance (p, p)"""
    allowed: Floats
    """Covariance (p, p) of what healthy estimates are off by beside their scatter"""
    tolerance: float
    """Standard deviations by which the estimate of a healthy axis may be off"""
    excess: float
    """Running innovation variance over lambda_0"""
    held: tuple[int, ...]
    """-1, 1: the estimate is at its lower, upper bound, or friction or damping is below zero; 0: neither"""
    past: Past
    """Earlier deviations"""
    stretches: int
    """Of the past, in three memory lengths"""
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Causes that are not monitored and look like a change of a parameter, by its name"""

    def since(self, t_us: int) -> tuple[Floats, Floats]:
        """The deviations (p,) that explain all samples since then with equal weight, and their covariance (p, p).

        At least those of three memory lengths, and no more than are kept.  The estimates forget: where the axis has
        moved little in the end, they hold little of what was learned.  If that time is to come, the clock was set back
        since, where what is kept begins.
        """
        later = len(self.past.t_us) if t_us > self.time_us else int(np.sum(self.past.t_us >= t_us))
        stretches = max(self.stretches, later)
        return lately(self.past, stretches) or (self.deviation, self.covariance)

    def earlier(self) -> "Evidence":
        """The evidence as it was three memory lengths before."""
        past, n = self.past, -self.stretches
        return replace(self, past=past._replace(t_us=past.t_us[:n], d=past.d[:n], P=past.P[:n]))

    def is_old(self, t_us: int) -> bool:
        """Whether that time lies three memory lengths in the past, in samples that were learned.

        If it is to come, the clock was set back since.
        """
        kept_us, set_back = self.past.t_us, t_us > self.time_us
        return len(kept_us) >= self.stretches and bool(set_back or t_us <= kept_us[-self.stretches])

    def is_forgotten(self, t_us: int) -> bool:
        """Whether that time lies before all that is kept."""
        return len(self.past.t_us) == KEPT and bool(t_us <= self.past.t_us[0])


CusumEvent = Crossing | Evidence
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
        self._theta0, self._divisor = model.theta0, settings.divisor
        self._dissipates = np.array([model.drive.parameter(name).nonnegative for name in model.monitored])
        # Between two columns, and between two deviations that are kept:
        naming, self._span = settings.naming_samples, settings.span
        self._span_s, self._correlation = naming * settings.interval_s, settings.lam**naming
        self._stretches = max(1, naming // self._span)
        self._lam = 1.0 if settings.random_walk else settings.lam**self._span
        alpha1 = settings.tests(len(self._names))[0]
        self._tolerance = float(alpha1.max() * np.sqrt(self._divisor))
        self._allowed = np.diag((settings.size_errors(len(self._names)) * model.scale) ** 2)
        self._alike = {TORQUE_CONSTANT: (LOAD,)} if model.carried_weight() else {}
        K = settings.gain(len(model.drive.states))
        lag_s = slowest_time_constant(model, K, settings.interval_s)
        self._lag_us = 1e6 * min(lag_s, 3 * settings.memory * settings.interval_s)

    def events(self, noted: EvidenceColumns, c: int, judged: bool) -> Iterator[Reading | Evidence]:
        """What column c of what was noted says: of an axis that is judged, a reading for the long-term trend, too."""
        s, p, value = self._s, len(self._names), noted.value[:, c]
        running, theta, d = float(value[0]), value[1 : 1 + p], value[1 + p : 1 + 2 * p].copy()
        V = s.lam0 * value[1 + 2 * p : -p].reshape(p, p) / self._divisor
        time_us, held = int(noted.what[2, c]), self._held(theta, theta - d, np.sqrt(V.diagonal()))
        if judged:
            holds = running <= INVALID * s.lam0
            known = (value[-p:] != UNSEEN) & (held == 0) & holds
            yield Reading(
                time_us=time_us,
                value=tuple((self._theta0 + d).tolist()),
                variance=tuple(V.diagonal().tolist()),
                known=tuple(known.tolist()),
                span_s=self._span_s,
                correlation=self._correlation,
                holds=holds,
            )
        yield Evidence(
            time_us=time_us,
            parameters=self._names,
            deviation=d,
            covariance=V,
            allowed=self._allowed,
            tolerance=self._tolerance,
            excess=running / s.lam0,
            held=tuple(held.tolist()),
            past=past_of(noted.t[c], noted.before[c], p, self._lam, self._walk(), s.lam0, self._lag_us),
            stretches=self._stretches,
            alike=self._alike,
        )

    def _walk(self) -> Floats:
        """What a random walk adds to the diagonal of P (p,) between two deviations."""
        s = self._s
        return self._span * (1 - s.lam) * self._P_nom if s.random_walk else np.zeros(len(self._names))

    def _held(self, theta: Floats, nominal: Floats, sd: Floats) -> Ints:
        """-1, 1 where the lower, the upper bound holds theta (p,); -1, too, where friction or damping is below zero."""
        lower, upper = self._bounds
        down = abs(theta - lower) <= HELD * abs(nominal - lower)
        down |= self._dissipates & (theta < -BELOW_ZERO * sd)
        up = abs(theta - upper) <= HELD * abs(nominal - upper)
        return 1 * (up & ~down) - down
