"""Supervision of P, which the paper asks for: P stays bounded, and each parameter is observed, weakly or not.

Forgetting without excitation lets P grow without bound.  Four measures:

* At standstill there is no information: while psi' P psi, whose steady mean is p (1 - lambda), nearly vanishes, theta,
  P
  and g are not updated (``check_excitation``).
* Excitation may be missing in some directions only (a constant speed, a single sine).  So information is forgotten
  towards a floor:  R <- lambda R + psi psi' + (1 - lambda) rho diag(1/P(0)),  R = P^-1, which bounds P_ii by
  P(0)_ii / rho in any case.  The floor is added once per span of updates (``apply_information_floor``), not at each.
* Parameters with a large part in a direction of which almost nothing is known are unobserved, and their estimates stay:
  in that direction the steps would come from noise and model errors.  A mere projection of the steps of theta would
  leak, and theta would drift within a day.
* P_ii / P(0)_ii measures the information on a parameter compared with commissioning.

Apart from these measures the recursion is that of the paper.  As P remains the true covariance, an estimate that has
become uncertain recovers with the first samples with excitation.
"""

import math
from typing import Any, NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import IDLE, SEED
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.state import OBSERVED, UNSEEN, WEAK

QUICK = 10.0
"""Ratio of the memory of theta to that of the running mean of the excitation."""
_WEAKER, _STRONGER = 2.5, 2.0
LOST, _FOUND = 10.0, 6.0
"""P_ii / P(0)_ii at which a parameter becomes weakly observed, and observed again; not observed, and observed again.
LOST is also the limit for directions."""
TAKES_PART = 0.3
"""A parameter takes part in a direction if its component, relative to its size, is at least this share of the
largest."""
_CLOSER = 4
_SWEEPS = 8


class FloorConstants(NamedTuple):
    """Fields of the Constants that the information floor uses."""

    floor: Floats
    min_excitation: Floats
    span: Floats
    lam: Floats
    scale: Floats


class ParameterInformation(NamedTuple):
    """Fields of the State with the information on the parameters."""

    P: Floats
    P_nom: Floats
    since: Ints
    unobserved: Ints
    observed: Ints


@kernel
def check_excitation(
    lanes: Any,
    lam_h: Floats,
    lam: Floats,
    least: Floats,
    S: Floats,
    excitation: Floats,
    mode: Ints,
    unobserved: Ints,
    observed: Ints,
) -> None:
    """Update the running mean of min(1, psi' P psi / (p (1 - lambda))); a lane below ``least`` is set to IDLE."""
    p = observed.shape[0]
    for a in range(len(lanes)):
        mean = p * (1.0 - lam[a])
        share = min(S[a] - lam_h[a], mean) / mean
        step = min(QUICK * (1.0 - lam[a]), 1.0) * (share - excitation[a])
        excitation[a] += step if mode[a] >= SEED and abs(step) < math.inf else 0.0
    for a in range(len(lanes)):
        if excitation[a] < least[a] and mode[a] >= SEED:
            mode[a] = IDLE
            unobserved[a] = p
            for i in range(p):
                observed[i, a] = UNSEEN


@kernel
def apply_information_floor(
    lanes: Any, con: FloorConstants, st: ParameterInformation, on: Ints, N: Floats, L: Floats, Y: Floats
) -> None:
    """Once in ``span`` updates: add the information floor to P, and classify each parameter.

    With N = P scaled by diag(P(0)), the sum is  (N^-1 + c I)^-1 = N - c N (I + c N)^-1 N;  I + c N = L L' can always be
    factored unless rounding has destroyed N, which then becomes I.  ``N``, ``L`` and ``Y`` (p, p) are scratch.
    """
    floor, least, span, lam, scale = con.floor, con.min_excitation, con.span, con.lam, con.scale
    P, P_nom, since, unobserved, observed = st.P, st.P_nom, st.since, st.unobserved, st.observed
    p = P.shape[0]
    for a in range(len(lanes)):
        if not on[a] or (floor[a] == 0.0 and least[a] == 0.0):
            continue
        since[a] += 1
        # While a direction is unobserved, the span is shorter, so that new information in it is used soon.
        if since[a] < (span[a] if unobserved[a] == 0 else span[a] // _CLOSER):
            continue
        # P stays below the bound until the next span: it grows like lambda^-t.
        c = (lam[a] ** -since[a] - 1.0) * floor[a]
        since[a] = 0
        for i in range(p):
            for j in range(p):
                N[i, j] = P[i, j, a] / math.sqrt(P_nom[i, a] * P_nom[j, a])
        good = factor(1.0, c, N, L)
        if good:
            _subtract(c, N, L, Y)
        for i in range(p):
            good = good and 0.0 < N[i, i] <= 2.0 / floor[a]
        for i in range(p):
            for j in range(p):
                if not good:
                    N[i, j] = 1.0 if i == j else 0.0
                P[i, j, a] = N[i, j] * math.sqrt(P_nom[i, a] * P_nom[j, a])
        for i in range(p):
            observed[i, a] = _classify(P[i, i, a] / P_nom[i, a], observed[i, a])
        unobserved[a] = 0
        if not factor(LOST, -1.0, N, L):
            _diagonalise(N, L)
            for k in range(p):
                if N[k, k] > LOST:
                    unobserved[a] += 1
                    _mark_unobserved(a, k, L, P_nom, scale, observed)


@outlined
def factor(alpha: float, c: float, N: Floats, L: Floats) -> bool:
    """Cholesky factor L of alpha I + c N, lower triangle; False if there is none."""
    p = N.shape[0]
    for j in range(p):
        for i in range(j, p):
            total = c * N[i, j] + (alpha if i == j else 0.0)
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not 0.0 < total < math.inf:
                    return False
                L[j, j] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True


@outlined
def _subtract(c: float, N: Floats, L: Floats, Y: Floats) -> None:
    """N <- N - c Y'Y with L Y = N, one triangle and its mirror image."""
    p = N.shape[0]
    for j in range(p):
        for i in range(p):
            total = N[i, j]
            for k in range(i):
                total -= L[i, k] * Y[k, j]
            Y[i, j] = total / L[i, i]
    for i in range(p):
        for j in range(i, p):
            total = 0.0
            for k in range(p):
                total += Y[k, i] * Y[k, j]
            N[i, j] -= c * total
            N[j, i] = N[i, j]


@outlined
def _diagonalise(N: Floats, U: Floats) -> None:
    """Jacobi's method, N = U diag U'; N becomes the diagonal."""
    p = N.shape[0]
    for i in range(p):
        for j in range(p):
            U[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        for i in range(p):
            for j in range(i + 1, p):
                _rotate(N, U, i, j)


@outlined
def _mark_unobserved(a: int, k: int, U: Floats, P_nom: Floats, scale: Floats, observed: Ints) -> None:
    """Parameters with a large share in direction k, relative to their sizes, are unobserved."""
    most = 0.0
    for i in range(U.shape[0]):
        most = max(most, abs(U[i, k]) * math.sqrt(P_nom[i, a]) / scale[i, a])
    for i in range(U.shape[0]):
        if abs(U[i, k]) * math.sqrt(P_nom[i, a]) / scale[i, a] > TAKES_PART * most:
            observed[i, a] = UNSEEN


@kernel
def _rotate(N: Floats, U: Floats, i: int, j: int) -> None:
    """Rotate rows and columns i and j so that N_ij vanishes."""
    if N[i, j] == 0.0:
        return
    tau = (N[j, j] - N[i, i]) / (2.0 * N[i, j])
    t = math.copysign(1.0, tau) / (abs(tau) + math.sqrt(1.0 + tau * tau))
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = t * c
    for k in range(N.shape[0]):
        N[k, i], N[k, j] = c * N[k, i] - s * N[k, j], s * N[k, i] + c * N[k, j]
    for k in range(N.shape[0]):
        N[i, k], N[j, k] = c * N[i, k] - s * N[j, k], s * N[i, k] + c * N[j, k]
        U[k, i], U[k, j] = c * U[k, i] - s * U[k, j], s * U[k, i] + c * U[k, j]


@kernel
def _classify(ratio: float, before: int) -> int:
    """Observed, weakly observed or unobserved, from P_ii / P(0)_ii, with hysteresis."""
    if ratio > LOST or (before == UNSEEN and ratio > _FOUND):
        return UNSEEN
    if ratio > _WEAKER or (before != OBSERVED and ratio > _STRONGER):
        return WEAK
    return OBSERVED


@kernel
def select_tests(
    lanes: Any,
    tested: Floats,
    observed: Ints,
    theta: Floats,
    on: Ints,
    theta_seen: Floats,
    tests: Ints,
    count: Ints,
) -> None:
    """Select the tests that run: not those of an unobserved parameter, whose last observed value is kept.

    On an axis that is not ``tested`` (W,), no test runs.  ``count`` (p, W): number of samples at which a test ran.
    """
    for i in range(theta.shape[0]):
        for a in range(len(lanes)):
            seen = on[a] and observed[i, a] != UNSEEN
            theta_seen[i, a] = theta[i, a] if seen else theta_seen[i, a]
            tests[i, a] = 1 if seen and tested[a] > 0.0 else 0
            count[i, a] += tests[i, a]
