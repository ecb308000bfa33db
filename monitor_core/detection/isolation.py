"""Isolation of the changed parameter: likelihood ratios of single faults, with the full covariance of the estimates.

If only theta_i has changed, by delta, then d = theta - theta_0 has the mean delta e_i.  With V = cov(d) and R = V^-1

    T_i = (R d)_i^2 / R_ii        is twice the logarithm of the likelihood ratio, chi-square(1) if nothing has changed
    delta = (R d)_i / R_ii        +/- 1 / sqrt(R_ii), the likeliest size
    d' R d - T_i                  the part that a change of theta_i does not explain, chi-square(p - 1) if it is the
    cause

where V = lambda_0 P / (1 + lambda) for the estimates of the recursion.  The probabilities of the causes are exp(T_i /
2) times their prior odds (equal by default), normalized to the sum one.  A parameter that is known to have changed, by
any amount, is left out: only the elements of d and V of the other parameters are used.

**Another payload** changes the weight and the inertia of the arm at once.  If the weight is monitored as ``load`` and
no inertia is, theta can only follow a larger inertia by less torque for each acceleration: all torques fall in the same
proportion.  The deviations of a payload therefore lie in the plane of the two directions

    -theta_0 (torques)    an inertia that is larger by a / (1 - a) lowers kT, friction and weight by the share a
    e_load                a weight that is larger by b, relative to the larger inertia: load = 1 - a + b

and T is the chi-square(2) of the best a and b.  A payload adds both, or takes both away: 0 < a / b < MAX_SHARE.  Where
the motor has most of the inertia, a is small, and ``load`` alone explains a payload.  Where the arm has
most of it, the plane nearly contains the direction of kT, and friction alone tells a payload from a torque constant.

If the weight is not monitored, theta can follow it in the first direction only: a payload that is heavier by b on an
axis whose weight it is lowers kT and friction by the share a = b / (1 + b).  So does an inertia that is larger by b on
an axis that bears no weight, as the base of an arm.  Both count as a change of kT.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri  # importing scipy.stats instead takes seconds

from monitor_core.arrays import Floats

RIDGE = 1e-9
"""Added to the eigenvalues of a correlation matrix, so that it can be inverted for indistinguishable parameters too"""

MIN_TOLERANCE = 3.3
"""Standard deviations; one estimate in a thousand is farther off."""


SECOND_DIRECTION = MIN_TOLERANCE**2
"""Chi-square by which a payload, which has a direction more, must explain more than a single parameter"""


FRICTION_OF_LOAD = 0.2
"""Standard deviation of the change of Coulomb friction with the load on its gear, as a share of that of the load"""

MAX_SHARE = 5.0
"""Share by which a payload raises the inertia over that by which it raises the weight, at most.  At the tip of an even
rod it is 1.5, at that of an arm with its mass near the joint 2.5; twice that allows for errors."""


class Payload(NamedTuple):
    """How another payload shows in theta, on an axis that bears a weight, and where no inertia is monitored."""

    load: int
    """Index of the parameter ``load``, or, if that is not monitored, of the torque constant"""
    inertia: Floats
    """(p,) change of theta with an inertia that is larger without limit: minus the nominal torques"""
    cost: float = SECOND_DIRECTION
    """Subtracted from the chi-square of a payload; 0 if the change is known to be a payload"""
    weighed: bool = True
    """Whether ``load`` is monitored"""
    coulomb: tuple[int, ...] = ()
    """Indices of Coulomb friction, which grows with the load on a gear"""

    def friction(self, size: float) -> Floats:
        """Covariance (p, p) of the change of Coulomb friction by a payload that changes the weight by this share."""
        sd = np.zeros(len(self.inertia))
        for i in self.coulomb:
            sd[i] = FRICTION_OF_LOAD * size * self.inertia[i]
        return np.diag(sd**2)


class Causes(NamedTuple):
    """Evidence for each parameter (p,); parameters known to have changed have T = 0 and probability 0."""

    T: Floats  # (p,) chi-square
    size: Floats  # (p,) size of the change, if the parameter alone has changed
    size_sd: Floats  # (p,)
    probability: Floats  # (p,)
    rest: float
    """Chi-square of the deviations that the likeliest cause does not explain"""
    freedom: int
    """Degrees of freedom of ``rest``"""
    payload: float = 0.0
    """Chi-square of another payload that also changes the inertia; 0 where that is not possible"""
    in_proportion: bool = False
    """Whether the likeliest cause is a payload that changes all torques in proportion, as no weight is monitored"""

    @property
    def best(self) -> int:
        """Index of the likeliest cause."""
        return int(self.probability.argmax())

    def explains(self, tolerance: float) -> bool:
        """Whether the most likely cause explains all deviations to within ``tolerance`` standard deviations."""
        return bool(self.rest <= limit(tolerance, self.freedom))

    def stands_out(self, tolerance: float) -> bool:
        """Whether the evidence for the likeliest cause exceeds ``tolerance`` standard deviations."""
        return bool(self.T[self.best] > limit(tolerance, 1))

    def is_like_payload(self, i: int) -> bool:
        """Whether a payload explains the deviations so well that parameter i cannot be preferred to it."""
        return bool(0 < self.payload > self.T[i] - SECOND_DIRECTION)


def limit(tolerance: float, freedom: int) -> float:
    """The chi-square with the same tail probability as ``tolerance`` standard deviations."""
    if not freedom:
        return np.inf
    tail = chdtrc(1, max(tolerance, MIN_TOLERANCE) ** 2)
    return float(chdtri(freedom, tail)) if tail > 0 else np.inf


def single_faults(
    d: Floats,
    V: Floats,
    known: Collection[int] = (),
    prior: Floats | None = None,
    payload: Payload | None = None,
) -> Causes:
    """Evidence for single causes of the deviations d (p,) with covariance V (p, p).

    ``known``: indices of parameters known to have changed.  ``prior`` (p,): prior odds, equal by default.  ``payload``:
    how another payload shows beyond its weight; it counts as a change of ``payload.load``.
    """
    p = len(d)
    rest = [i for i in range(p) if i not in known]
    T, size, size_sd, probability = np.zeros(p), np.zeros(p), np.full(p, np.inf), np.zeros(p)
    if not rest:
        return Causes(T, size, size_sd, probability, 0.0, 0)
    # Beside a torque that may have changed by any amount, a larger inertia cannot be seen.
    possible = payload and set(known) <= ({payload.load} if payload.weighed else set())
    heavier = _heavier(d, V, payload) if payload and possible else None
    R, scale = _information(V[np.ix_(rest, rest)])
    Rd = R @ (d[rest] / scale)
    if payload and heavier and payload.load in known:
        R, Rd = _without(payload.inertia[rest] / scale, R, Rd)
    R_ii = np.diag(R)
    T[rest], size[rest], size_sd[rest] = Rd**2 / R_ii, scale * Rd / R_ii, scale / np.sqrt(R_ii)
    explained, directions, in_proportion = T.copy(), np.ones(p, int), False
    if payload and heavier and payload.load in rest and heavier.T - payload.cost > T[payload.load]:
        load = payload.load
        T[load], size[load], size_sd[load] = heavier.T - payload.cost, heavier.weight, heavier.weight_sd
        explained[load], directions[load] = heavier.T, 2 if payload.weighed else 1
        in_proportion = not payload.weighed
    logs = T[rest] / 2 + (0.0 if prior is None else np.log(prior[rest]))
    weight = np.exp(logs - logs.max())
    probability[rest] = weight / weight.sum()
    best = probability.argmax()
    left, freedom = float(d[rest] / scale @ Rd - explained[best]), max(len(rest) - int(directions[best]), 0)
    in_proportion = in_proportion and payload is not None and bool(best == payload.load)
    return Causes(T, size, size_sd, probability, left, freedom, heavier.T if heavier else 0.0, in_proportion)


def sizes(d: Floats, V: Floats, changed: Sequence[int], payload: Payload | None = None) -> tuple[Floats, Floats]:
    """Sizes and standard deviations of the changes of the parameters ``changed``, if no others have changed.

    ``payload``: how a change of ``payload.load`` alone shows beyond the weight.
    """
    J = list(changed)
    heavier = _heavier(d, V, payload) if payload and [payload.load] == J else None
    R, scale = _information(V)
    if payload and heavier:
        T = float((R @ (d / scale))[payload.load] ** 2 / R[payload.load, payload.load])
        if payload.weighed or heavier.T - payload.cost > T:
            return np.array([heavier.weight]), np.array([heavier.weight_sd])
    covariance = np.linalg.inv(R[np.ix_(J, J)])
    return scale[J] * (covariance @ (R @ (d / scale))[J]), scale[J] * np.sqrt(np.diag(covariance))


class _Heavier(NamedTuple):
    """Another payload, as the deviations show it."""

    T: float
    """Chi-square of the deviations that it explains"""
    weight: float
    """Change of the weight; of the torque constant, if no weight is monitored"""
    weight_sd: float


def _heavier(d: Floats, V: Floats, payload: Payload) -> _Heavier | None:
    """The likeliest payload that changes weight and inertia; None: no payload changes them so.

    The weight would become less with a larger inertia, or the inertia would grow far more than the weight.  Where it is
    known that there is another payload, only deviations beyond the tolerance show that.
    """
    R, scale = _information(V)
    if not payload.weighed:
        along = payload.inertia / scale
        length = float(along @ R @ along)
        share = float(along @ R @ (d / scale)) / length
        kT = float(payload.inertia[payload.load])
        return _Heavier(share**2 * length, share * kT, abs(kT) / float(np.sqrt(length)))
    directions = np.column_stack([payload.inertia, np.arange(len(d)) == payload.load]) / scale[:, np.newaxis]
    information, explained = directions.T @ R @ directions, directions.T @ R @ (d / scale)
    covariance = np.linalg.pinv(information, hermitian=True)
    a, b = covariance @ explained
    T = float(explained @ (a, b))
    more = -b / payload.inertia[payload.load]  # relative, as a
    if a * more <= 0 or abs(a) > MAX_SHARE * abs(more):
        # The estimates scatter: of a known payload the one nearest to them counts, if it is within their tolerance.
        edge = np.array([1.0, -payload.inertia[payload.load] / MAX_SHARE])
        a, b = edge * (edge @ explained) / (edge @ information @ edge)
        beyond, T = T - float(explained @ (a, b)), float(explained @ (a, b))
        weight_alone = float(explained[1] ** 2 / information[1, 1])
        if payload.cost or beyond > SECOND_DIRECTION or weight_alone >= T:
            return None
    if a >= 1:
        return None
    slopes = np.array([b / (1 - a) ** 2, 1 / (1 - a)])  # of the weight b / (1 - a)
    weight_sd = float(np.sqrt(slopes @ covariance @ slopes))
    return _Heavier(T, float(b / (1 - a)), weight_sd)


def _without(direction: Floats, R: Floats, Rd: Floats) -> tuple[Floats, Floats]:
    """R and R d if the deviations may also have any part in this direction: what lies in it is no evidence."""
    along = R @ direction
    length = max(float(direction @ along), RIDGE)
    return R - np.outer(along, along) / length + RIDGE * np.eye(len(R)), Rd - along * (direction @ Rd) / length


def _information(V: Floats) -> tuple[Floats, Floats]:
    """The inverse of V in units of its standard deviations, and these standard deviations.

    Without the units the inverse would be inexact, as parameters differ by many orders of magnitude.  For a diverging
    predictor, rounding may give V a direction of negative variance, which counts as zero.
    """
    scale = np.sqrt(np.diag(V))
    values, vectors = np.linalg.eigh(V / np.outer(scale, scale))
    return (vectors / (np.maximum(values, 0.0) + RIDGE)) @ vectors.T, scale
