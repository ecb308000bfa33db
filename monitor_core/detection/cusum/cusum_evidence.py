"""Events of the CUSUM tests of an axis: crossings of h, and evidence about the parameters since then.

The kernel notes the estimates three memory lengths after a crossing, and every three memory lengths.
``EvidenceBuilder`` makes evidence, and readings for the long-term trend, from the noted columns.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.detection.alarm import TORQUE_CONSTANT, Direction
from monitor_core.detection.isolation import Payload
from monitor_core.detection.onset import Past, lately, past_of
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.friction_roles import friction_of
from monitor_core.drive.kalman import slowest_time_constant
from monitor_core.drive.structure import DELAY, LOAD
from monitor_core.kernel.evidence import KEPT, EvidenceColumns
from monitor_core.kernel.state import UNSEEN
from monitor_core.settings import Settings
from monitor_core.trend.entries import EstimateReading

INVALID = 100.0
"""Ratio of the running innovation variance to lambda_0 above which the model does not hold: errors ten times larger."""

HELD = 0.1
"""An estimate counts as held at a bound within this share of the distance from the nominal value to the bound."""
BELOW_ZERO = 2.0
"""Standard deviations.  Friction or damping below zero by more than this is impossible: something else drives the
axis."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """The g of a parameter has crossed its h.  Times in microseconds since 1970."""

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
    """Covariance of ``deviation`` (p, p)"""
    allowed: Floats
    """Covariance (p, p) of the errors of healthy estimates beyond their scatter"""
    tolerance: float
    """Largest error of the estimate of a healthy axis, in standard deviations"""
    excess: float
    """Running innovation variance over lambda_0"""
    held: tuple[int, ...]
    """-1, 1: the estimate is at its lower, upper bound, or friction or damping is below zero; 0: neither"""
    past: Past
    """Earlier deviations"""
    stretches: int
    """Number of stretches of the past in three memory lengths"""
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """By name of a parameter: causes that are not monitored and look like a change of it"""
    payload: Payload | None = None
    """How another payload shows, if the axis bears a weight and no inertia is monitored"""

    def since(self, t_us: int) -> tuple[Floats, Floats]:
        """Deviations (p,) that explain all samples since ``t_us`` with equal weight, and their covariance (p, p).

        At least three memory lengths are used, and at most the kept past.  (The last estimates alone forget: if the
        axis has moved little in the end, they contain little of the information.)  If ``t_us`` is in the future, the
        clock was set back since; then all of the past is used, which begins there.
        """
        later = len(self.past.t_us) if t_us > self.time_us else int(np.sum(self.past.t_us >= t_us))
        stretches = max(self.stretches, later)
        return lately(self.past, stretches) or (self.deviation, self.covariance)

    def until(self, t_us: int) -> "Evidence":
        """The evidence with its past up to ``t_us``."""
        return self._with_past(int(np.sum(self.past.t_us <= t_us)))

    def earlier(self) -> "Evidence":
        """The evidence with its past up to three memory lengths before."""
        return self._with_past(-self.stretches)

    def _with_past(self, n: int) -> "Evidence":
        """The evidence with the first n entries of its past."""
        past = self.past
        return replace(self, past=past._replace(t_us=past.t_us[:n], d=past.d[:n], P=past.P[:n]))

    def with_payload(self, size: float) -> "Evidence":
        """The evidence where another payload is known, whose weight differs by this share of the nominal one.

        It stays a payload while that explains the deviations as well as another parameter; and it may change Coulomb
        friction, too.
        """
        if self.payload is None:
            return self
        known, allowed = self.payload._replace(cost=0.0), self.allowed + self.payload.friction(size)
        return replace(self, payload=known, allowed=allowed)

    def is_old(self, t_us: int) -> bool:
        """Whether ``t_us`` lies at least three memory lengths in the past, counted in learned samples.

        If it is in the future, the clock was set back since.
        """
        kept_us, set_back = self.past.t_us, t_us > self.time_us
        return len(kept_us) >= self.stretches and bool(set_back or t_us <= kept_us[-self.stretches])

    def is_forgotten(self, t_us: int) -> bool:
        """Whether ``t_us`` lies before the kept past, which is full."""
        return len(self.past.t_us) == KEPT and bool(t_us <= self.past.t_us[0])


CusumEvent = Crossing | Evidence
BatchEvent = CusumEvent | EstimateReading
"""Events of an axis batch: those of the tests, and readings for the long-term trend"""


class EvidenceBuilder:
    """Makes the evidence of one axis.

    ``lower`` and ``upper`` (p,): bounds of theta, views into the batch, which are read when there is evidence.
    """

    def __init__(self, model: AxisModel, settings: Settings, lower: Floats, upper: Floats) -> None:
        self._names, self._s, self._bounds = model.monitored, settings, (lower, upper)
        self._theta0, self._divisor = model.theta0, settings.divisor
        self._dissipates = np.array([model.drive.parameter(name).nonnegative for name in model.monitored])
        # Number of samples between two columns, and between two kept deviations.
        naming, self._span = settings.naming_samples, settings.span
        self._span_s, self._correlation = naming * settings.interval_s, settings.lam**naming
        self._stretches = max(1, naming // self._span)
        self._lam = settings.lam**self._span
        alpha1 = settings.tests(len(self._names))[0]
        self._tolerance = float(alpha1.max() * np.sqrt(self._divisor))
        self._allowed = np.diag((settings.size_errors(len(self._names)) * model.scale) ** 2)
        self._alike = {TORQUE_CONSTANT: (LOAD,)} if model.carried_weight() else {}
        self._torques = _torques(model)
        coulomb = friction_of(model.drive).coulomb
        self._coulomb = tuple(i for i, name in enumerate(self._names) if name in coulomb)
        K = settings.gain(len(model.drive.states))
        lag_s = slowest_time_constant(model, K, settings.interval_s)
        self._lag_us = 1e6 * min(lag_s, 3 * settings.memory * settings.interval_s)

    def events(self, noted: EvidenceColumns, c: int, judged: bool) -> Iterator[EstimateReading | Evidence]:
        """Evidence from column c of the noted ones; if the axis is tested (``judged``), a trend reading before it."""
        s, p, value = self._s, len(self._names), noted.value[:, c]
        running, theta, d = float(value[0]), value[1 : 1 + p], value[1 + p : 1 + 2 * p].copy()
        V = s.lam0 * value[1 + 2 * p : -p].reshape(p, p) / self._divisor
        time_us, held = int(noted.what[2, c]), self._held(theta, theta - d, np.sqrt(V.diagonal()))
        if judged:
            holds = running <= INVALID * s.lam0
            known = (value[-p:] != UNSEEN) & (held == 0) & holds
            yield EstimateReading(
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
            past=past_of(noted.t[c], noted.before[c], p, self._lam, s.lam0, self._lag_us),
            stretches=self._stretches,
            alike=self._alike,
            payload=self._payload(theta - d),
        )

    def _payload(self, nominal: Floats) -> Payload | None:
        """How another payload shows at the present nominal values (p,)."""
        if self._torques is None:
            return None
        weighed = LOAD in self._names
        shown_by = self._names.index(LOAD if weighed else TORQUE_CONSTANT)
        return Payload(shown_by, np.where(self._torques, -nominal, 0.0), weighed=weighed, coulomb=self._coulomb)

    def _held(self, theta: Floats, nominal: Floats, sd: Floats) -> Ints:
        """Flags (p,): -1 at the lower bound, or for friction or damping below zero; 1 at the upper bound; else 0."""
        lower, upper = self._bounds
        down = abs(theta - lower) <= HELD * abs(nominal - lower)
        down |= self._dissipates & (theta < -BELOW_ZERO * sd)
        up = abs(theta - upper) <= HELD * abs(nominal - upper)
        return 1 * (up & ~down) - down


def _torques(model: AxisModel) -> NDArray[np.bool_] | None:
    """Which parameters are in proportion to a torque (p,); None: a payload changes nothing beyond ``load``.

    Or it changes theta in another way than these directions describe: if an inertia is monitored, if another parameter,
    such as a stiffness, follows the payload, or if neither the weight is monitored nor kT, which follows it then.
    """
    weighed = LOAD in model.monitored
    if not weighed and TORQUE_CONSTANT not in model.monitored:
        return None
    if model.arm_inertia() is None:
        return None
    friction = friction_of(model.drive)
    names = {TORQUE_CONSTANT, LOAD, *friction.viscous, *friction.coulomb, *model.drive.constant_torques()}
    torques = np.array([name in names for name in model.monitored])
    return torques if all(torques | (np.array(model.monitored) == DELAY)) else None
