"""Two CUSUM tests for each parameter (paper eq. 21-23), with the onset."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.evidence import NAMING
from monitor_core.kernel.state import NEVER

UP, DOWN = 0, 1
"""Kinds of event: g of an increase or of a decrease crossed h."""


class Events(NamedTuple):
    """Events of a block, in order of the samples.  The first ``filled[0]`` columns are valid."""

    filled: NDArray[np.int64]  # (1,)
    what: NDArray[np.int64]  # (5, capacity): kind, axis, parameter, time us, onset us


class TestConstants(NamedTuple):
    """Fields of the Constants that the tests use."""

    theta0: Floats
    alpha1: Floats
    allowance: Floats
    lam0: Floats
    h: Floats
    widen: Floats
    naming_samples: Floats


class TestState(NamedTuple):
    """Fields of the State that the tests use."""

    theta: Floats
    P: Floats
    P_nom: Floats
    shift: Floats
    g: Floats
    onset: Ints
    left: Ints
    noting: Ints


@kernel
def compute_deviations(lanes: Any, con: TestConstants, st: TestState, d: Floats, nu: Floats) -> None:
    """d = theta_i - theta0_i and nu = alpha1 sqrt(lam0 P_ii) + allowance   (p, W)   (eq. 22; the allowance is ours).

    theta0 includes the shift by the operating conditions.
    """
    theta0, alpha1, allowance, lam0 = con.theta0, con.alpha1, con.allowance, con.lam0
    theta, P, shift = st.theta, st.P, st.shift
    for i in range(theta.shape[0]):
        for a in range(len(lanes)):
            d[i, a] = theta[i, a] - theta0[i, a] - shift[i, a]
            nu[i, a] = alpha1[i, a] * math.sqrt(lam0[a] * P[i, i, a]) + allowance[i, a]


@kernel
def update_cusum(lanes: Any, h: Floats, t: Ints, g: Floats, onset: Ints, d: Floats, nu: Floats, on: Ints) -> bool:
    """g = max(0, g + d - nu) for d and for -d (eq. 21).  True if any lane's g exceeds its h.

    The onset is the last time at which g was zero, or the first sample.      ``on`` (p, W): which tests run.
    """
    crossed = False
    for i in range(d.shape[0]):
        # Each loop writes one array and has no conditional loads: otherwise there is no SIMD.
        for way in range(2):
            for a in range(len(lanes)):
                before = g[way, i, a]
                after = max(0.0, before + (d[i, a] if way == UP else -d[i, a]) - nu[i, a])
                g[way, i, a] = after if on[i, a] else before
            for a in range(len(lanes)):
                before_us, now_us = onset[way, i, a], t[a]
                zero = (g[way, i, a] == 0.0) | (before_us == NEVER)
                onset[way, i, a] = now_us if (on[i, a] != 0) & zero else before_us
            for a in range(len(lanes)):
                crossed |= g[way, i, a] > h[i, a]
    return crossed


@outlined
def note_crossings(
    lanes: Any, con: TestConstants, st: TestState, t: Ints, on: Ints, a0: int, reset: bool, events: Events
) -> None:
    """Note every g > h (eq. 23).  Then g restarts from 0 if ``reset``, the paper's rule; in its Figure 6 g continues.

    P_ii is raised to at least ``widen`` (W,) times P(0)_ii, so that the changed theta_i converges faster.  A larger
    diagonal keeps P positive definite.  After ``naming_samples`` more samples the evidence for the cause is noted.
    """
    h, widen, needed = con.h, con.widen, con.naming_samples
    g, onset, P, P_nom, left, noting = st.g, st.onset, st.P, st.P_nom, st.left, st.noting
    for i in range(on.shape[0]):
        for a in range(len(lanes)):
            for way in range(2):
                if not (on[i, a] and g[way, i, a] > h[i, a]):
                    continue
                _note(events, way, a0 + a, i, t[a], onset[way, i, a])
                P[i, i, a] = max(P[i, i, a], widen[a] * P_nom[i, a])
                if noting[a] != NAMING:
                    left[a], noting[a] = int(needed[a]), NAMING
                if reset:
                    g[way, i, a] = 0.0
                    onset[way, i, a] = t[a]


@outlined
def _note(events: Events, kind: int, axis: int, i: int, t: int, onset: int) -> None:
    filled, what = events.filled, events.what
    k = filled[0]
    filled[0] = k + 1
    what[0, k] = kind
    what[1, k] = axis
    what[2, k] = i
    what[3, k] = t
    what[4, k] = onset
