"""Rejects outliers: innovations that noise does not explain.  A few are rejected; many are a change of the axis.

After a fault, the innovations may exceed every limit for seconds, and these samples are needed to detect the fault.  So
an axis has a credit of outliers: each outlier costs one, and many samples earn one.  Without credit the samples are
used, but their innovations are limited to the outlier limit (bounded influence).  The state is corrected only from the
third outlier in a row on: then the state is more likely wrong than the sensor.  Such a row is a jolt, in which an
unmeasured torque acts: a collision, a closing brake.  As long as there is credit, theta is not updated until a while
after the jolt.  If all samples since the start are outliers, the first sample, from which the state started, was wrong.
"""

import math
from typing import Any, NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import DOUBTED, RESTART, SEED, SETTLE, Roles
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.state import SETTLING

CREDIT = 3.0
"""Smallest full credit: number of outliers in a row that are rejected."""
JOLT_S = 1.0
"""The full credit is at least the outliers in this time [s]: a collision, or a closing brake, is over by then."""
AFTER = 0.1
"""A jolt is over after this share of ``JOLT_S`` without an outlier."""
SURELY = 3
"""Number of outliers in a row that are not errors of the sensor."""
COMES_BACK = 0.02
"""Credit earned per sample: this share of the samples may be outliers."""
PEAK = 1.5
"""Least ratio of the outlier limit to the largest innovation of the healthy records."""
_CLIP = 3.0
_CLIPPED_MEAN = 0.99501
"""E min(z^2, 9) of a normal z."""


class OutlierConstants(NamedTuple):
    """Fields of the Constants that outlier rejection uses."""

    outlier: Floats  # (W,) standard deviations beyond which an innovation is an outlier; 0: never
    least: Floats  # (W,) lower bound of the limit, in the unit of the output
    most: Floats  # (W,) largest credit


@kernel
def reject_outliers(
    lanes: Any,
    con: OutlierConstants,
    lam: Floats,
    lam0_running: Floats,
    eps: Floats,
    S: Floats,
    credit: Floats,
    in_a_row: Ints,
    roles: Roles,
    believed: Floats,
) -> None:
    """Reject an outlier: eps beyond ``outlier`` standard deviations of its prediction; 0: there is no limit.

    The limit is at least ``least``, which healthy records do not exceed: an innovation that the fit has used is used by
    the estimates, too.  ``believed`` (W,): innovation that updates theta.
    """
    mode, moves, learns, tracks = roles.mode, roles.moves, roles.learns, roles.tracks
    for a in range(len(lanes)):
        believed[a] = eps[a]
        if not moves[a] or con.outlier[a] == 0.0:
            continue
        limit = max(con.outlier[a] * math.sqrt(lam0_running[a]), con.least[a])
        limit *= math.sqrt(1.0 + (S[a] - lam[a]) / (1.0 + lam[a]))
        out = abs(eps[a]) > limit
        if out:
            in_a_row[a] = in_a_row[a] + 1 if in_a_row[a] + 1 < SURELY else SURELY + int(AFTER * con.most[a])
        else:
            in_a_row[a] = in_a_row[a] - 1 if in_a_row[a] > SURELY else 0
        credit[a] = min(credit[a] + COMES_BACK, con.most[a])
        if in_a_row[a] == 0:
            continue
        moves[a] = in_a_row[a] >= SURELY
        believed[a] = min(max(eps[a], -limit), limit)
        if mode[a] > DOUBTED and credit[a] >= 1.0:
            credit[a] -= 1.0
            learns[a] = tracks[a] = 0
            mode[a] = DOUBTED


@kernel
def check_start(
    lanes: Any,
    settle_us: Floats,
    interval: Floats,
    t: Ints,
    settled: Ints,
    in_a_row: Ints,
    counts: Ints,
    mode: Ints,
) -> None:
    """Restart with the third sample after a start if all three are outliers.

    This happens only once per start, and does not extend the settling time.  It also happens if an axis starts in a
    motion that is not rigid: then its predictor starts three samples later.
    """
    for a in range(len(lanes)):
        since = t[a] - settled[a] + settle_us[a]
        if mode[a] == SETTLE and in_a_row[a] >= SURELY and since <= (SURELY + 0.5) * interval[a] * 1e6:
            counts[SETTLING, a] += 1
            mode[a] = RESTART


@kernel
def update_running_variance(
    lanes: Any, lam: Floats, lam_slow: Floats, lam0_running: Floats, eps: Floats, S: Floats, mode: Ints
) -> None:
    """Running innovation variance: eps^2 has the mean lam0 (1 + psi' P psi / (1 + lambda)) in steady state.

    Each sample counts as at most nine times the mean, so that outliers hardly raise it (Huber's proposal 2), while a
    lasting change does.
    """
    for a in range(len(lanes)):
        excess = (S[a] - lam[a]) / (1.0 + lam[a])
        square = min(eps[a] * eps[a] / (1.0 + excess), _CLIP * _CLIP * lam0_running[a]) / _CLIPPED_MEAN
        step = (1.0 - lam_slow[a]) * (square - lam0_running[a])
        lam0_running[a] += step if mode[a] >= SEED and abs(step) < math.inf else 0.0
