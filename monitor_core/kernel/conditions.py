"""The conditions that an axis works under: nominal values that follow them, and gates that close."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.admission import GATED, SEED, SKIP
from monitor_core.kernel.compile import kernel


@kernel
def follow(
    lanes: Any,
    k: int,
    a0: int,
    to: Floats,
    lower: Floats,
    upper: Floats,
    shift: Floats,
    theta: Floats,
    theta_seen: Floats,
    does: Ints,
) -> None:
    """theta_0(s) moves to ``to[k]`` (p, W) beside theta_0, and the estimate along with it: theta - theta_0(s) stays.

    Where it is not a number the conditions are not known: the last ones hold, and nothing is learned.
    """
    for i in range(shift.shape[0]):
        for a in range(len(lanes)):
            wanted = to[k, i, min(a0 + a, to.shape[2] - 1)]
            step = wanted - shift[i, a]
            if does[a] == SKIP:
                continue
            if abs(step) < math.inf:
                shift[i, a] = wanted
                theta[i, a] = min(max(theta[i, a] + step, lower[i, a]), upper[i, a])
                theta_seen[i, a] += step
            elif does[a] >= SEED:
                does[a] = GATED


@kernel
def close(lanes: Any, k: int, a0: int, gate: NDArray[np.bool_], does: Ints) -> None:
    """Where the gate (N, W) is closed the sample is predicted, so that the state stays true, and nothing is learned."""
    for a in range(len(lanes)):
        if does[a] >= SEED and not gate[k, min(a0 + a, gate.shape[1] - 1)]:
            does[a] = GATED
