"""Two CUSUM tests for each parameter (paper eq. 21-23), with the onset and the calm that an episode needs."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monitor_core.kernel.state import State
from monitor_core.kernel.tables import Constants, Floats, Ints

UP, DOWN, CALM = 0, 1, 2
"""Kinds of event: g of an increase or of a decrease crossed h; the deviation has been below nu long enough."""


class Events(NamedTuple):
    """What happened in a block, in order of the samples.  The first ``count[0]`` entries are valid."""

    count: NDArray[np.int64]  # (1,)
    what: NDArray[np.int64]  # (5, capacity): kind, axis, parameter, time us, onset us
    value: NDArray[np.float64]  # (2, capacity): theta and P_ii at that sample


@njit(cache=True, nogil=True)
def _note(events: Events, kind: int, axis: int, i: int, t: int, onset: int, theta: float, P_ii: float) -> None:
    k = events.count[0]
    events.count[0] = k + 1
    events.what[0, k] = kind
    events.what[1, k] = axis
    events.what[2, k] = i
    events.what[3, k] = t
    events.what[4, k] = onset
    events.value[0, k] = theta
    events.value[1, k] = P_ii


@njit(cache=True, nogil=True)
def cusum(
    lanes: Any, p: int, con: Constants, st: State, on: Ints, first_axis: int, events: Events, reset: bool
) -> None:
    """g = max(0, g + d - nu), d = +/-(theta_i - theta0_i), nu = alpha1 sqrt(lam0 P_ii); g > h is an alarm.

    After an alarm g starts again from 0 if ``reset`` (the paper's rule; its Figure 6 shows g run on instead).
    The onset is the last time at which g was zero.
    """
    for i in range(p):
        for a in range(len(lanes)):
            if not on[a]:
                continue
            d = st.theta[i, a] - con.theta0[i, a]
            nu = con.alpha1[a] * math.sqrt(con.lam0[a] * st.P[i, i, a])
            for way in range(2):
                g = max(0.0, st.g[way, i, a] + (d if way == 0 else -d) - nu)
                if g == 0.0:
                    st.onset[way, i, a] = st.t[a]
                if g > con.h[i, a]:
                    onset = st.onset[way, i, a]
                    _note(events, way, first_axis + a, i, st.t[a], onset, st.theta[i, a], st.P[i, i, a])
                    if reset:
                        g = 0.0
                        st.onset[way, i, a] = st.t[a]
                st.g[way, i, a] = g
            st.calm[i, a] = st.calm[i, a] + 1 if abs(d) <= nu else 0
            if st.calm[i, a] == con.calm[a]:
                _note(events, CALM, first_axis + a, i, st.t[a], st.t[a], st.theta[i, a], st.P[i, i, a])
