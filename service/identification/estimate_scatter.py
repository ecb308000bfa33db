"""How much wider recursive estimates scatter than white prediction errors would make them.

Where the noise model is not right, neighbouring errors go together, and a sum of N of them is larger than sqrt(N) of
one.  The daemon's standard deviations come from lambda_0 P, so lambda_0 must be larger by what that costs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DELAY, split_name
from monitor_core.identification.estimate import Estimate
from monitor_core.identification.fit import fit_starts
from monitor_core.identification.predictor import Predictor
from monitor_core.identification.record import Record
from monitor_core.identification.residual_spectrum import scores_covariance


def colour_of(estimate: Estimate, monitored: Sequence[str], records: Sequence[Record]) -> float:
    """Variance of estimates of the monitored parameters over what white errors would give, the largest; at least 1.

    All else is held, as in the daemon: values, K and delay are those that were found, and what follows signals does.

    Raises:
        ValueError: a record that does not go with the estimate.
    """
    found = estimate.problem
    K = tuple(estimate.K.tolist()) if found.predictor == "innovations" else None
    free = _free(found.varying, monitored)
    varying = {name: signals for name, signals in found.varying.items() if name in free}
    problem = replace(
        found, drive=estimate.drive, nominal=estimate.values, free=free,
        K=K, disturbance=None, delay_s=estimate.delay_s, free_delay=DELAY in monitored,
        bounds={}, varying=varying,
    )  # fmt: skip
    predictor = Predictor(problem, records, None)
    errors = predictor.errors(fit_starts(predictor))
    end = len(free) + sum(map(len, varying.values()))  # of parameters and slopes; the delay comes after them
    own, start = [*range(len(free)), *[end] * problem.free_delay], end + problem.free_delay
    psi = [_beside(e.psi[:, own], e.psi[:, start:]) for e in errors]
    size = np.sqrt(sum((J**2).sum(axis=0) for J in psi))
    psi = [J / np.where(size > 0, size, 1.0) for J in psi]  # their units differ by orders of magnitude
    inverse = np.linalg.pinv(sum(J.T @ J for J in psi), hermitian=True)
    S, _ = scores_covariance([e.eps for e in errors], psi)
    white, coloured = np.diag(estimate.lam0 * inverse), np.diag(inverse @ S @ inverse)
    return float(np.max(coloured / white, initial=1.0, where=white > 0))


def _free(varying: Iterable[str], monitored: Sequence[str]) -> tuple[str, ...]:
    """The monitored parameters, those that follow something as Ja or 1/Ja, whichever has the slopes."""
    called = {split_name(name)[0]: name for name in varying}
    return tuple(called.get(split_name(name)[0], name) for name in monitored if name != DELAY)


def _beside(psi: Floats, start: Floats) -> Floats:
    """What the initial state does not explain of the gradients."""
    Q = np.linalg.qr(start)[0]
    return np.asarray(psi - Q @ (Q.T @ psi))
