"""How far the kernel is from the transcription."""

import numpy as np
from numpy.typing import NDArray

from monitor_core.kernel.block import Trace
from tests.core.oracle.paper import Log

TOLERANCE = 1e-9


def apart(kernel: NDArray[np.float64], paper: list[NDArray[np.float64]] | list[float]) -> float:
    """Largest difference, relative to the largest value of each column."""
    reference = np.array(paper).reshape(kernel.shape)
    assert (np.isnan(kernel) == np.isnan(reference)).all()
    scale = np.nanmax(np.abs(reference), axis=0)
    return float(np.nanmax(np.abs(kernel - reference) / np.where(scale > 0, scale, 1)))


def worst(trace: Trace, log: Log) -> dict[str, float]:
    moved = ~np.isnan(np.array(log.psi)[:, 0])
    diagonal = [np.diag(P) for P in log.P]
    return {
        "eps": apart(trace.eps, log.eps),
        "psi": apart(trace.psi[moved], list(np.array(log.psi)[moved])),
        "theta": apart(trace.theta, log.theta),
        "P": apart(trace.P, diagonal),
        "g": apart(trace.g, log.g),
    }
