"""How far the kernel is from the transcription."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monitor_core.excitation.reference_experiment import Experiment
from monitor_core.kernel.block import Trace
from monitor_core.monitoring import AxisBatch
from tests.core.oracle.paper import Log, Paper

TOLERANCE = 1e-9


def apart(kernel: NDArray[np.float64], paper: list[NDArray[np.float64]] | list[float]) -> float:
    """Largest difference, relative to the largest value of each column."""
    reference = np.array(paper).reshape(kernel.shape)
    assert (np.isnan(kernel) == np.isnan(reference)).all()
    scale = np.nanmax(np.abs(reference), axis=0)
    return float(np.nanmax(np.abs(kernel - reference) / np.where(scale > 0, scale, 1)))


def worst(trace: Trace, log: Log) -> dict[str, float]:
    """Of a bank of one axis."""
    one = Trace(*(field[..., 0] for field in trace))
    moved = ~np.isnan(np.array(log.psi)[:, 0])
    return {
        "eps": apart(one.eps, log.eps),
        "psi": apart(one.psi[moved], list(np.array(log.psi)[moved])),
        "theta": apart(one.theta, log.theta),
        "P": apart(one.P, [np.diag(P) for P in log.P]),
        "g": apart(one.g, log.g),
    }


def between(bank: AxisBatch, trace: Trace, paper: Paper) -> dict[str, float]:
    """As ``worst``, with all of P and the running lambda_0 at the end."""
    return worst(trace, paper.log) | {
        "all of P": float(np.abs(bank.state.P[:, :, 0] / paper.P - 1).max()),
        "lambda_0": abs(float(bank.state.lam0_running[0]) / paper.running - 1),
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
