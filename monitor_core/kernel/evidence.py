"""Evidence: the deviations of all parameters with their covariance, from which causes are told apart.

A change has arrived in theta some memory lengths after it has happened.  So from the first crossing of an axis on the
samples that are learned are counted, and theta - theta_0 and P are noted when they are enough.  Otherwise, too, each
time that so many have been learned, for the slow course of the parameters.  How theta went until then is kept for a
while, for the onset of a change.  All of it depends on samples only, not on how they are cut into blocks.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined

COURSE, NAMING = 0, 1
"""What evidence is for: the slow course of the parameters, or the name of what has crossed its threshold."""

KEPT = 64
"""Deviations that are kept of the time before: one in each quarter of a memory."""


class EvidenceColumns(NamedTuple):
    """What was noted in a block, in order of the samples.  The first ``filled[0]`` columns are valid."""

    filled: NDArray[np.int64]  # (1,)
    what: NDArray[np.int64]  # (4, capacity): COURSE or NAMING, axis, time us, number of the events before it
    value: NDArray[
        np.float64
    ]  # (noted_numbers, capacity): running variance, theta, theta - theta0, P, observed
    t: NDArray[
        np.int64
    ]  # (capacity, KEPT) NAMING: times of the deviations before, us, oldest first; NEVER: none
    before: NDArray[np.float64]  # (capacity, KEPT, kept_numbers) these deviations and P, its upper triangle


def kept_numbers(p: int) -> int:
    """How many numbers are kept of one moment: the deviations, and the upper triangle of P."""
    return p + p * (p + 1) // 2


def noted_numbers(p: int) -> int:
    """How many numbers are noted."""
    return 1 + 3 * p + p * p


_numbers = outlined(kept_numbers)


@outlined
def samples_until_kept(lanes: Any, span: Floats, learned: Ints) -> Ints:
    """How many samples (W,) are to be learned until what is known is kept: each time that ``span`` divides ``learned``.

    Counted down from here on, as a remainder in each sample would take a tenth of the time of it all.
    """
    until = np.zeros_like(learned)
    for a in range(len(lanes)):
        until[a] = int(span[a]) - learned[a] % int(span[a])
    return until


@kernel
def gather_evidence(
    lanes: Any,
    needed: Floats,
    span: Floats,
    t: Ints,
    left: Ints,
    until: Ints,
    noting: Ints,
    learned: Ints,
    below_nu: Ints,
    lam0_running: Floats,
    theta: Floats,
    d: Floats,
    P: Floats,
    observed: Ints,
    on: Ints,
    a0: int,
    kept_t: Ints,
    kept_d: Floats,
    events: Ints,
    noted: Any,
) -> None:
    """Count the samples that are learned, ``on`` (W,); keep theta - theta_0 of now and then, note what is due."""
    keeps = notes = False
    for a in range(len(lanes)):
        left[a] -= on[a]
        learned[a] += on[a]
        until[a] -= on[a]
        keeps |= until[a] == 0
        notes |= (on[a] != 0) & (left[a] <= 0)
    if keeps:
        _keep(lanes, span, t, until, learned, d, P, a0, kept_t, kept_d)
    if notes:
        _note(
            lanes,
            needed,
            span,
            t,
            left,
            noting,
            learned,
            below_nu,
            lam0_running,
            theta,
            d,
            P,
            observed,
            on,
            a0,
            kept_t,
            kept_d,
            events,
            noted,
        )


@outlined
def _keep(
    lanes: Any,
    span: Floats,
    t: Ints,
    until: Ints,
    learned: Ints,
    d: Floats,
    P: Floats,
    a0: int,
    kept_t: Ints,
    kept_d: Floats,
) -> None:
    """What is known now in place of the oldest; ``learned`` (W,) are the samples learned so far."""
    p = d.shape[0]
    for a in range(len(lanes)):
        if until[a] == 0:
            until[a] = int(span[a])
            k = learned[a] // int(span[a]) % KEPT
            kept_t[k, a0 + a] = t[a]
            row = k * _numbers(p)
            for i in range(p):
                kept_d[row + i, a0 + a] = d[i, a]
            row += p
            for i in range(p):
                for j in range(i, p):
                    kept_d[row, a0 + a] = P[i, j, a]
                    row += 1


@outlined
def _note(
    lanes: Any,
    needed: Floats,
    span: Floats,
    t: Ints,
    left: Ints,
    noting: Ints,
    learned: Ints,
    below_nu: Ints,
    lam0_running: Floats,
    theta: Floats,
    d: Floats,
    P: Floats,
    observed: Ints,
    on: Ints,
    a0: int,
    kept_t: Ints,
    kept_d: Floats,
    events: Ints,
    noted: Any,
) -> None:
    """A column for each lane that is due.

    A parameter whose calm has been noted may be named only now: its calm is counted again, so that the alarm ends.
    """
    p = d.shape[0]
    for a in range(len(lanes)):
        if not on[a] or left[a] > 0:
            continue
        c = noted.filled[0]
        noted.filled[0] = c + 1
        noted.what[0, c], noted.what[1, c], noted.what[2, c], noted.what[3, c] = (
            noting[a],
            a0 + a,
            t[a],
            events[0],
        )
        noted.value[0, c] = lam0_running[a]
        for i in range(p):
            noted.value[1 + i, c] = theta[i, a]
            noted.value[1 + p + i, c] = d[i, a]
            for j in range(p):
                noted.value[1 + 2 * p + p * i + j, c] = P[i, j, a]
            noted.value[1 + 2 * p + p * p + i, c] = observed[i, a]
        if noting[a] == NAMING:
            newest = learned[a] // int(span[a])
            for q in range(KEPT):
                k = (newest + 1 + q) % KEPT
                noted.t[c, q] = kept_t[k, a0 + a]
                for i in range(noted.before.shape[2]):
                    noted.before[c, q, i] = kept_d[k * noted.before.shape[2] + i, a0 + a]
            for i in range(p):
                below_nu[i, a] = 0 if below_nu[i, a] > needed[a] else below_nu[i, a]
        left[a], noting[a] = int(needed[a]), COURSE
