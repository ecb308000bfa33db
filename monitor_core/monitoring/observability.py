"""Which combinations of parameters the last samples say nothing of, in words."""

from collections.abc import Sequence

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.kernel.supervision import LOST, TAKES_PART


def confounded(P: Floats, P_nom: Floats, scale: Floats, names: Sequence[str]) -> tuple[str, ...]:
    """What is not observed now: parameters, or several that only show together.

    Args:
        P: of the recursion (p, p).
        P_nom: commissioned P_ii (p,).
        scale: sizes of the parameters (p,).
        names: of the parameters (p,).
    """
    size = np.sqrt(P_nom)
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    moves = abs(vectors[:, values > LOST] * (size / scale)[:, np.newaxis]).T
    return tuple(_words([names[i] for i in np.flatnonzero(v > TAKES_PART * v.max()).tolist()]) for v in moves)


def untold(pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Why nothing is tested, where the nominal values are not good enough for that."""
    return tuple(
        f"{one} and {other} cannot be told apart by the record of their nominal values: nothing is tested"
        for one, other in pairs
    )


def _words(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{names[0]} is not observed"
    return f"{', '.join(names[:-1])} and {names[-1]} cannot be told apart"
