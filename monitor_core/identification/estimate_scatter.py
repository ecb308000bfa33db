"""How much more recursive estimates scatter than they would with white prediction errors.

Where the noise model is not right, neighbouring errors are correlated, and a sum of N of them is larger than sqrt(N) of
one.  The standard deviations of the daemon come from lambda_0 P, so lambda_0 must be larger by this factor.
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
    """Largest ratio of the variance of a monitored parameter to its variance with white errors; at least 1.

    Everything else is held, as in the daemon: values, K and delay are the estimates, and schedules are followed.

    Raises:
        ValueError: a record of another output than the drive's.
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
    """The monitored parameters; a scheduled one by the name (Ja or 1/Ja) that has the slopes."""
    called = {split_name(name)[0]: name for name in varying}
    return tuple(called.get(split_name(name)[0], name) for name in monitored if name != DELAY)


def _beside(psi: Floats, start: Floats) -> Floats:
    """The part of the gradients that the initial state does not explain."""
    Q = np.linalg.qr(start)[0]
    return np.asarray(psi - Q @ (Q.T @ psi))
