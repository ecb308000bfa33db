"""Innovations that noise does not explain: a few are outliers and are rejected, many are a change of the axis.

A fault may put the innovations beyond every limit for seconds, and these samples are needed to detect it.  So an axis
has a credit of outliers: each one costs one, and one is earned with many samples.  Without credit the samples are used,
but limited to the outlier limit (bounded influence).  The state is corrected only by the third outlier in a row: then
the state is more likely wrong than the sensor.  Such a row is a jolt, in which a torque acts that nobody measures: a
collision, a brake that closes.  Nothing is learned until it is over for a while, as far as the credit goes.  If all
samples since the start are outliers, the first sample was wrong, from which the state started.
"""

import math
from typing import Any, NamedTuple

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import DOUBTED, RESTART, SEED, SETTLE, Roles
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.state import SETTLING

CREDIT = 3.0
"""Outliers in a row that are passed over, at least."""
JOLT_S = 1.0
"""And those of so many seconds [s]: a collision, or a brake that closes, is over by then."""
AFTER = 0.1
"""A jolt is over after so long without an outlier, as a share of that."""
SURELY = 3
"""So many in a row are no mistake of the sensor."""
COMES_BACK = 0.02
"""Credit per sample: so large a share of the samples may be outliers."""
PEAK = 1.5
"""The limit over the largest innovation of the healthy records, at least."""
_CLIP = 3.0
_CLIPPED_MEAN = 0.99501
"""E min(z^2, 9) of a normal z."""


class OutlierConstants(NamedTuple):
    """Of the Constants of an axis."""

    outlier: Floats  # (W,) standard deviations beyond which an innovation is an outlier; 0: never
    least: Floats  # (W,) the limit in the unit of the output, at least
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

    The limit is at least ``least``, which healthy records do not exceed: where the axis vibrates as then, that is
    no mistake of the sensor, and what the fit has used the estimates use, too.  ``believed`` (W,) is the innovation
    that theta learns from.
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

    This happens once only, and keeps the settling time.  It also happens where an axis starts in a motion that is not
    rigid: it then starts three samples later.
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
