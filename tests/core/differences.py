"""How far the kernel is from the transcription."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.block import Trace
from tests.core.oracle.paper import Log, Paper

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


def by_rounding(paper: Callable[[], Paper], rec: Experiment, log: Log) -> float:
    """How far the transcription itself moves when every input is changed in its last place, at most of three times."""
    rng, most = np.random.default_rng(1), 0.0
    for _ in range(3):
        other = paper()
        other.run(
            rec.t_us, *(np.nextafter(field, rng.choice([-np.inf, np.inf], field.shape)) for field in rec[1:])
        )
        most = max(most, apart(np.array(other.log.theta), log.theta), apart(np.array(other.log.g), log.g))
    return most
