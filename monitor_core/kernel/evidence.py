"""Evidence: deviations of all parameters with their covariance, from which the cause of a change is isolated.

Theta has converged some memory lengths after a change.  So learned samples are counted from the first crossing of an
axis, and theta - theta_0 and P are noted after enough of them.  They are also noted at regular intervals, for the
long-term trend.  Past deviations are kept for a while, to find the onset of a change.  All this depends on the samples
only, not on how they are divided into blocks.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined

COURSE, NAMING = 0, 1
"""Purposes of evidence: the long-term trend of the parameters, or the name of a change after a crossing."""

KEPT = 64
"""Number of past deviations that are kept: one in each quarter of a memory."""


class EvidenceColumns(NamedTuple):
    """Evidence noted in a block, in order of the samples.  The first ``filled[0]`` columns are valid."""

    filled: NDArray[np.int64]  # (1,)
    what: NDArray[np.int64]  # (4, capacity): COURSE or NAMING, axis, time us, number of the events before it
    value: NDArray[np.float64]  # (noted_numbers, capacity): running variance, theta, theta - theta0, P, observed
    t: NDArray[np.int64]  # (capacity, KEPT) NAMING: times of the deviations before, us, oldest first; NEVER: none
    before: NDArray[np.float64]  # (capacity, KEPT, kept_numbers) these deviations and P, its upper triangle


class Kept(NamedTuple):
    """Kept past deviations of all axes: a part of the state that is rarely used."""

    t: Ints  # (KEPT, axes) us
    d: Floats  # (KEPT kept_numbers, axes) these deviations and P, its upper triangle


def kept_numbers(p: int) -> int:
    """Number of values kept for one time: the deviations and the upper triangle of P."""
    return p + p * (p + 1) // 2


def noted_numbers(p: int) -> int:
    """Number of values in a column of evidence."""
    return 1 + 3 * p + p * p


_numbers = outlined(kept_numbers)


class EvidenceState(NamedTuple):
    """Fields of the State and the Constants that evidence is made from, and its counters."""

    theta: Floats
    P: Floats
    lam0_running: Floats
    observed: Ints
    left: Ints
    noting: Ints
    learned: Ints
    span: Floats
    naming_samples: Floats


@kernel
def count_until_kept(lanes: Any, span: Floats, learned: Ints, until: Ints) -> None:
    """Number of samples (W,) to learn until values are kept, which is whenever ``span`` divides ``learned``.

    The counter is decremented from here on: a remainder in each sample would take a tenth of the recursion's time.
    """
    for a in range(len(lanes)):
        until[a] = int(span[a]) - learned[a] % int(span[a])


@kernel
def gather_evidence(
    lanes: Any,
    st: EvidenceState,
    t: Ints,
    until: Ints,
    d: Floats,
    on: Ints,
    a0: int,
    kept: Kept,
    events: Ints,
    noted: EvidenceColumns,
) -> None:
    """Count the learned samples, ``on`` (W,); keep theta - theta_0 at regular intervals; note evidence that is due."""
    left, learned = st.left, st.learned
    keeps = notes = False
    for a in range(len(lanes)):
        left[a] -= on[a]
        learned[a] += on[a]
        until[a] -= on[a]
        keeps |= until[a] == 0
        notes |= (on[a] != 0) & (left[a] <= 0)
    if keeps:
        _keep(lanes, st, t, until, d, a0, kept)
    if notes:
        _note(lanes, st, t, d, on, a0, kept, events, noted)


@outlined
def _keep(lanes: Any, st: EvidenceState, t: Ints, until: Ints, d: Floats, a0: int, kept: Kept) -> None:
    """Keep the present values in place of the oldest ones."""
    span, learned, P, p = st.span, st.learned, st.P, d.shape[0]
    for a in range(len(lanes)):
        if until[a] == 0:
            until[a] = int(span[a])
            k = learned[a] // int(span[a]) % KEPT
            kept.t[k, a0 + a] = t[a]
            row = k * _numbers(p)
            for i in range(p):
                kept.d[row + i, a0 + a] = d[i, a]
            row += p
            for i in range(p):
                for j in range(i, p):
                    kept.d[row, a0 + a] = P[i, j, a]
                    row += 1


@outlined
def _note(
    lanes: Any,
    st: EvidenceState,
    t: Ints,
    d: Floats,
    on: Ints,
    a0: int,
    kept: Kept,
    events: Ints,
    noted: EvidenceColumns,
) -> None:
    """Note a column for each lane that is due."""
    needed, span, theta, P, observed = st.naming_samples, st.span, st.theta, st.P, st.observed
    left, noting, learned = st.left, st.noting, st.learned
    p = d.shape[0]
    for a in range(len(lanes)):
        if not on[a] or left[a] > 0:
            continue
        c = noted.filled[0]
        noted.filled[0] = c + 1
        noted.what[0, c], noted.what[1, c] = noting[a], a0 + a
        noted.what[2, c], noted.what[3, c] = t[a], events[0]
        noted.value[0, c] = st.lam0_running[a]
        for i in range(p):
            noted.value[1 + i, c] = theta[i, a]
            noted.value[1 + p + i, c] = d[i, a]
            for j in range(p):
                noted.value[1 + 2 * p + p * i + j, c] = P[i, j, a]
            noted.value[1 + 2 * p + p * p + i, c] = observed[i, a]
        newest = learned[a] // int(span[a])
        for q in range(KEPT):
            k = (newest + 1 + q) % KEPT
            noted.t[c, q] = kept.t[k, a0 + a]
            for i in range(noted.before.shape[2]):
                noted.before[c, q, i] = kept.d[k * noted.before.shape[2] + i, a0 + a]
        left[a], noting[a] = int(needed[a]), COURSE
