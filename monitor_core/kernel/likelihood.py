"""Log-likelihood ratios of the multi-model detector, their CUSUMs, and the times from which the onset is estimated."""

import math
from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel, outlined
from monitor_core.kernel.predictors import (
    ALLOWANCE,
    FROZEN,
    LEVEL,
    LIMIT,
    PRECISION,
    STILL,
    TOLERATED,
    UNEXPLAINED,
)
from monitor_core.kernel.state import NEVER

SURE = math.log(2 / 0.1)
"""The interval of a change is where the path of the CUSUM is within this of its minimum.  It covers the change with at
least 90 %: before the change and after it, the path of the true hypothesis falls so far below its value at the change
with a probability below exp(-SURE)."""
MARKS = 6
"""Number of past times at which the path had fallen by successive steps of SURE / (MARKS - 1)."""
_STEP = SURE / (MARKS - 1)
_CLIP = 36.0
"""Upper limit of squared innovations over their variance."""

G, FALLEN, HELD_BACK, SINCE_DETECTION, SUMS = range(5)
"""Rows of the sums: g; decrease of its path since the last mark; evidence in addition to g; logarithm of the likelihood
ratio of the samples since the detection.  SUMS: number of rows."""
ONSET, LATE, FIRST_MARK = 0, 1, 2
"""Rows of the times: g was last 0; g was last below SURE; marks, the latest first."""


@kernel
def log_likelihood_ratios(
    lanes: Any, own: Floats, back: int, moved: bool, turned: bool, eps: Floats, llr: Floats
) -> None:
    """Compute l_i (H,); minus infinity if a hypothesis says that torque or output is stuck, and it changes at all.

    ``back``: lane of the healthy axis.  Its prediction differs from the reference by the effect of the active faults, a
    share of which remains as model error.  A hypothesis that explains only this remainder is no second fault.
    """
    step = min(eps[0] * eps[0] * own[PRECISION, 0], _CLIP)
    effect = eps[back] - eps[0]
    explained = min(effect * effect * own[PRECISION, 0], _CLIP)
    for a in range(len(lanes)):
        there = min(eps[a] * eps[a] * own[PRECISION, a], _CLIP)
        alive = not (moved and own[STILL, a] > 0.0) and not (turned and own[FROZEN, a] > 0.0)
        likelier = 0.5 * (step - there) + own[LEVEL, a]
        llr[a] = likelier - 0.5 * own[UNEXPLAINED, a] * explained if alive else -math.inf


@kernel
def update_sums(lanes: Any, own: Floats, t: int, watching: bool, llr: Floats, sums: Floats, when: Ints) -> bool:
    """g = max(0, g + l), with the times for the onset and its interval; True if any g > h.

    HELD_BACK + g is the sum of l without the tolerated part of the allowance, since g was last 0 before the detection;
    ``watching`` is False after the detection.
    """
    crossed, marked = 0, 0
    # Loops with few arrays and without branches, which the compiler turns into vectors.
    for a in range(len(lanes)):
        free = sums[G, a] + llr[a]
        held = sums[HELD_BACK, a] + own[TOLERATED, a] + min(0.0, free)
        goes_on = own[TOLERATED, a] > 0.0 and (free > 0.0 or not watching)
        sums[HELD_BACK, a] = held if goes_on else 0.0
        sums[G, a] = max(0.0, free)
        sums[FALLEN, a] += max(0.0, -free)
    for a in range(len(lanes)):
        onset, late = when[ONSET, a], when[LATE, a]
        when[ONSET, a] = t if sums[G, a] == 0.0 else onset
        when[LATE, a] = t if sums[G, a] < SURE else late
    for a in range(len(lanes)):
        marked += 1 if sums[FALLEN, a] >= _STEP else 0
        crossed += 1 if sums[G, a] > own[LIMIT, a] else 0
    if marked:
        _mark(t, sums, when)
    return crossed > 0


@outlined
def add_likelihood_ratios(lanes: Any, own: Floats, eps: Floats, sums: Floats) -> None:
    """SINCE_DETECTION, the evidence for sizes: without allowances, which are no evidence, and without a limit at zero.

    The samples before the detection do not count, as they were selected by it.
    """
    step = min(eps[0] * eps[0] * own[PRECISION, 0], _CLIP)
    for a in range(len(lanes)):
        there = min(eps[a] * eps[a] * own[PRECISION, a], _CLIP)
        sums[SINCE_DETECTION, a] += 0.5 * (step - there) + own[LEVEL, a] + own[ALLOWANCE, a]


@outlined
def _mark(t: int, sums: Floats, when: Ints) -> None:
    """Note the time at which the path of a hypothesis has fallen by another step."""
    for j in range(when.shape[0] - 1, FIRST_MARK - 1, -1):
        for a in range(sums.shape[1]):
            if sums[FALLEN, a] >= _STEP:
                when[j, a] = when[j - 1, a] if j > FIRST_MARK else t
    for a in range(sums.shape[1]):
        fallen = sums[FALLEN, a]
        sums[FALLEN, a] = 0.0 if fallen >= _STEP else fallen


@outlined
def restart_paths(t: int, when: Ints) -> None:
    """Begin the paths with the first sample.  The marks stay: what is there from the start may have begun before it."""
    for a in range(when.shape[1]):
        for j in range(FIRST_MARK):
            when[j, a] = t if when[j, a] == NEVER else when[j, a]
