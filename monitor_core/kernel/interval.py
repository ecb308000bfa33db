"""What hangs on the real interval of a sample: the forgetting factor and the filter gain."""

import math
from typing import Any

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import kernel
from monitor_core.kernel.outliers import SURELY
from monitor_core.kernel.tables import GAINS

_EQUAL_S = 1e-9
"""Intervals that differ by less than a microsecond, in which they are counted, are equal."""


@kernel
def walk(lanes: Any, drift: Floats, seed_left: Ints, lam: Floats, share: Floats) -> None:
    """Where parameters drift (W,) nothing is forgotten: lambda (W,) is 1, and ``share`` of P(0) is added, 1 - lambda.

    So P_ii has the steady value that it has with lambda where a parameter is alone: psi^2 = (1 - lambda) / P in both.
    """
    for a in range(len(lanes)):
        walks = drift[a] > 0.0 and seed_left[a] == 0
        share[a] = 1.0 - lam[a] if walks else 0.0
        lam[a] = 1.0 if walks else lam[a]


@kernel
def corrected_ago(lanes: Any, interval: Floats, h: Floats, in_a_row: Ints, ago: Floats) -> None:
    """How long ago the state was corrected (W,): h, and an interval for each outlier passed over since then."""
    for a in range(len(lanes)):
        ago[a] = h[a] + (interval[a] * in_a_row[a] if in_a_row[a] < SURELY else 0.0)


@kernel
def for_interval(
    lanes: Any, interval: Floats, lam: Floats, K: Floats, h: Floats, ago: Floats, lam_h: Floats, K_h: Floats
) -> None:
    """lambda^(h / interval) (W,), and K (n, W) where the state was corrected so long ``ago`` (W,).

    A memory is a time: a sample that is missing ages what is known as one that came.  The gain, which grows as the
    prediction grows uncertain, is interpolated between those after 0, 1, 2 .. whole intervals, the rows of ``K``.
    """
    n, usual = K_h.shape[0], True
    for a in range(len(lanes)):
        lam_h[a] = lam[a]
        usual &= (abs(h[a] - interval[a]) < _EQUAL_S) & (abs(ago[a] - interval[a]) < _EQUAL_S)
    if usual:
        for i in range(n):
            for a in range(len(lanes)):
                K_h[i, a] = K[n + i, a]
        return
    for a in range(len(lanes)):
        if abs(h[a] - interval[a]) >= _EQUAL_S:
            lam_h[a] = math.exp(h[a] / interval[a] * math.log(lam[a]))
        r = 1.0 if abs(ago[a] - interval[a]) < _EQUAL_S else ago[a] / interval[a]
        k = min(int(r), GAINS - 2)
        part = min(r - k, 1.0)
        for i in range(n):
            before = K[k * n + i, a]
            K_h[i, a] = before + part * (K[(k + 1) * n + i, a] - before) if part > 0.0 else before
