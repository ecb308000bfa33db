"""Coulomb friction over an interval, from the predicted speed at the middle of the interval.

Friction from the speed at the beginning would be half an interval late.  The acceleration at the beginning is A x + b,
where b comes from all inputs except friction, plus B_c tanh(s_c v) for each friction.  So the speed at the middle is
the solution v of

    v = v_0 + h/2 (A x + b + sum B_c tanh(s_c v))          (row of the speed in A, B)

s_c is the factor of the speed in friction c.  With w the part of v without friction, one step of the iteration
v = w + h/2 sum B_c tanh(s_c v) suffices if it starts from the solution v_1 for tanh(s v) = s v.  For an axis at
standstill this is also exact, and stable for any interval:

    v_1 = w / (1 - h/2 sum B_c s_c),     v = w + h/2 sum B_c tanh(s_c v_1),     u_c = tanh(s_c v)

The length of the interval is known only at its end.  So friction is computed with the sample that ends the interval,
from the values at its beginning.
"""

import math
from typing import Any, NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.llvm_vectors import power_of_two
from monitor_core.kernel.recursion import add_products, predict
from monitor_core.kernel.tables import COULOMB, TORQUE, FrictionTerms

SMALLEST = 0.5
"""Lower limit of the divisor of v_1, so that a strongly negative friction (which drives the axis) keeps its sign."""


class MiddleSpeed(NamedTuple):
    """Work arrays of ``hold_friction``."""

    u: Floats  # (m, W) inputs from which w and v are computed: mean torque, frictions at v_1
    v: Floats  # (W,) w, and then v
    v1: Floats  # (W,)
    divisor: Floats  # (W,)
    rate: Floats  # (W,) dv = (1 + rate) dw for constant B
    dw: Floats  # (p, W)
    dv: Floats  # (p, W)
    slope: Floats  # (p, W) d/dtheta_i of h/2 sum B_c s_c


@kernel
def mean_torque_share(delay: float, h: float) -> float:
    """Share of the held torque in the speed at the middle of the interval; the rest is that of the torque before.

    The share is (1 - delay / h)^2, as in the mean speed of the interval, for a torque that acts from ``delay`` on.  A
    torque that acts before its sample has already moved the drive by then, to first order as in ``switch_torque``.
    """
    late = min(delay, h) / h if h > 0.0 else 0.0
    return 1.0 - 2.0 * late + (late * late if late > 0.0 else 0.0)


@outlined
def _rub(lanes: Any, kind: Ints, u_scale: Floats, v: Floats, u: Floats) -> None:
    """Write the frictions tanh(s_c v) to their rows of u (m, W)."""
    for c in range(kind.size):
        if kind[c] == COULOMB:
            for a in range(len(lanes)):
                u[c, a] = tanh(u_scale[c, a] * v[a])


@outlined
def hold_friction(
    lanes: Any,
    F: FrictionTerms,
    kind: Ints,
    u_scale: Floats,
    V: Floats,
    delay: Floats,
    torque_before: Floats,
    h: Floats,
    X: Floats,
    u: Floats,
    du: Floats | None,
    work: MiddleSpeed,
) -> None:
    """Write the friction over an interval h (W,) to u (m, W), and its derivatives to du (p, m, W), unless that is None.

    On entry u contains the other held inputs, and in the rows of friction a measured speed v_0.
    """
    v, v1, divisor, w_u, dw = work.v, work.v1, work.divisor, work.u, work.dw
    p = dw.shape[0]
    n = X.shape[0] // (p + 1)
    slot, src, par = F.braked.slot, F.braked.src, F.braked.par
    for c in range(kind.size):
        what = kind[c]
        for a in range(len(lanes)):
            w_u[c, a] = u[c, a]
        if what == TORQUE:
            for a in range(len(lanes)):
                share = mean_torque_share(delay[a], h[a])
                w_u[c, a] = share * u[c, a] + (1.0 - share) * torque_before[a]
        elif what == COULOMB and F.filtered:
            for a in range(len(lanes)):
                v1[a] = X[p * n + F.state, a]
        elif what == COULOMB:
            for a in range(len(lanes)):
                v1[a] = u[c, a]
    predict(lanes, F.motion, V, X, v, dw)
    add_products(lanes, F.driven, V, w_u, v, dw)
    for a in range(len(lanes)):
        v[a] = v1[a] + 0.5 * h[a] * v[a]
        divisor[a] = 1.0
    for q in range(slot.size):
        s, c = slot[q], src[q]
        if par[q] < 0:
            for a in range(len(lanes)):
                divisor[a] -= 0.5 * h[a] * V[s, a] * u_scale[c, a]
    for a in range(len(lanes)):
        divisor[a] = max(divisor[a], SMALLEST)
        v1[a] = v[a] / divisor[a]
    _rub(lanes, kind, u_scale, v1, w_u)
    for q in range(slot.size):
        s, c = slot[q], src[q]
        if par[q] < 0:
            for a in range(len(lanes)):
                v[a] += 0.5 * h[a] * V[s, a] * w_u[c, a]
    if du is not None:
        _slopes(lanes, F, kind, u_scale, V, delay, torque_before, h, X, u, work)
    _rub(lanes, kind, u_scale, v, u)
    if du is not None:
        for c in range(kind.size):
            if kind[c] == COULOMB:
                for i in range(p):
                    for a in range(len(lanes)):
                        du[i, c, a] = (1.0 - u[c, a] * u[c, a]) * u_scale[c, a] * work.dv[i, a]


@kernel
def _slopes(
    lanes: Any,
    F: FrictionTerms,
    kind: Ints,
    u_scale: Floats,
    V: Floats,
    delay: Floats,
    torque_before: Floats,
    h: Floats,
    X: Floats,
    u: Floats,
    work: MiddleSpeed,
) -> None:
    """Derivatives dv (p, W) of v; on entry dw contains the derivatives of the acceleration."""
    v1, divisor, w_u, rate = work.v1, work.divisor, work.u, work.rate
    dw, dv, slope, p = work.dw, work.dv, work.slope, work.dw.shape[0]
    slot, src, par = F.braked.slot, F.braked.src, F.braked.par
    n = X.shape[0] // (p + 1)
    for q in range(F.driven.slot.size if F.late >= 0 else 0):
        c = F.driven.src[q]
        if kind[c] == TORQUE and F.driven.par[q] < 0:
            for a in range(len(lanes)):
                rest = max(1.0 - max(delay[a], 0.0) / h[a], 0.0) / h[a] if h[a] > 0.0 else 0.0
                dw[F.late, a] += V[F.driven.slot[q], a] * 2.0 * rest * (torque_before[a] - u[c, a])
    for i in range(p):
        for a in range(len(lanes)):
            dw[i, a] = 0.5 * h[a] * dw[i, a] + (X[i * n + F.state, a] if F.filtered else 0.0)
            dv[i, a] = dw[i, a]
            slope[i, a] = rate[a] = 0.0
    for q in range(slot.size):
        s, c, i = slot[q], src[q], par[q]
        for a in range(len(lanes)):
            half = 0.5 * h[a] * V[s, a]
            if i < 0:
                rate[a] += half * (1.0 - w_u[c, a] * w_u[c, a]) * u_scale[c, a] / divisor[a]
            else:
                dv[i, a] += half * w_u[c, a]
                slope[i, a] += half * u_scale[c, a] if divisor[a] > SMALLEST else 0.0
    for i in range(p):
        for a in range(len(lanes)):
            dv[i, a] += rate[a] * (dw[i, a] + slope[i, a] * v1[a])


# --- Hyperbolic tangent without branches, which the compiler can vectorise over lanes ---------------------------------


# The function of the C library is called for each lane separately and takes a tenth of the time of a sample.
# tanh x = e / (e + 2),   e = exp(2 x) - 1 = 2^k (exp(r) - 1) + 2^k - 1,   2 x = k log 2 + r,   |r| <= log(2) / 2

_ONE_FROM = 20.0
"""From here on tanh is 1 to the last bit."""
_WHOLE = 1.5 * 2.0**52
"""Added to a number that is not large, and taken away again: rounds it to a whole number."""
_LOG2_HIGH, _LOG2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""log 2 in two parts: the first has so few digits that its products with k are exact."""
_C = tuple(1.0 / math.factorial(k) for k in range(14))


@kernel
def tanh(x: float) -> float:
    """Tanh x, with an error below three units of its last place; exactly odd."""
    double = 2.0 * min(abs(x), _ONE_FROM)
    k = (double * (1.0 / math.log(2.0)) + _WHOLE) - _WHOLE
    r = (double - k * _LOG2_HIGH) - k * _LOG2_LOW
    z = r * r
    even = _C[2] + z * (_C[4] + z * (_C[6] + z * (_C[8] + z * (_C[10] + z * _C[12]))))
    odd = _C[3] + z * (_C[5] + z * (_C[7] + z * (_C[9] + z * (_C[11] + z * _C[13]))))
    power = power_of_two(k)
    e = power * (r + z * (even + r * odd)) + (power - 1.0)
    return math.copysign(e / (e + 2.0), x)
