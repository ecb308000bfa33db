"""Covariance of the estimates, without initial states, valid also for coloured prediction errors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.structure import DELAY, split_name
from monitor_core.excitation.accuracy import Accuracy
from monitor_core.identification.greybox.criterion import fit_starts
from monitor_core.identification.greybox.estimate import Estimate
from monitor_core.identification.greybox.residuals import scores_covariance
from monitor_core.identification.predictor.prediction_errors import Predictor
from monitor_core.identification.records.record import Record

_SEEN = 1e-12


class Information(NamedTuple):
    """Information in the records."""

    accuracy: Accuracy  # the same, relative to the sizes, with what is not determined
    covariance: Floats  # (p, p) of the estimates; infinite variance and NaN where they cannot be told
    order: int  # of the errors' autoregressive model; 0: white


def information(
    names: Sequence[str],
    sizes: Floats,
    gradients: Sequence[Floats],
    starts: Sequence[Floats],
    eps: Sequence[Floats],
    variance: float,
) -> Information:
    """Covariance of estimates by prediction errors.

        cov = (J'J)^-1 S (J'J)^-1,     S = sum_ts psi(t) R(t - s) psi(s)'

    which for white errors is lambda_0 (J'J)^-1, J being what the initial states cannot explain of the gradients.

    Args:
        names: of the p parameters.
        sizes: (p,) units in which they are compared: their own size, for most.
        gradients: (N, p) psi of each record.
        starts: (N, n) gradient by the record's initial state; n may be 0.
        eps: (N,) errors, of each record, zero where missing.
        variance: of the errors, lambda_0.
    """
    own = [_unexplained(psi, start) for psi, start in zip(gradients, starts, strict=True)]
    scaled = [psi * sizes for psi in own]
    R: Floats = np.asarray(np.linalg.qr(np.concatenate(scaled), mode="r"))
    accuracy = Accuracy(tuple(names), R, np.sqrt(variance) if variance > 0 else 1e-300)
    S, order = scores_covariance(eps, scaled)
    if order == 0:
        return Information(accuracy, accuracy.covariance * np.outer(sizes, sizes), 0)
    with np.errstate(invalid="ignore"):
        inverse = _pseudo_inverse(R)
        known = np.isfinite(np.diag(accuracy.covariance))
        covariance = accuracy.covariance.copy()
        covariance[np.ix_(known, known)] = (inverse @ S @ inverse)[np.ix_(known, known)]
        return Information(_as_told(accuracy, covariance), covariance * np.outer(sizes, sizes), order)


def _as_told(accuracy: Accuracy, covariance: Floats) -> Accuracy:
    """The information of white errors that gives this covariance; unchanged where some variance is infinite."""
    if not np.isfinite(covariance).all():
        return accuracy
    sd = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    if values[0] <= 0:
        return accuracy
    root = (vectors / np.sqrt(values)).T / sd
    return Accuracy(accuracy.names, root * accuracy.noise, accuracy.noise)


def _unexplained(psi: Floats, start: Floats) -> Floats:
    """The part of the columns of psi that those of ``start`` do not explain."""
    if not start.shape[1]:
        return psi
    lengths = np.linalg.norm(start, axis=0)
    left, sizes, _ = np.linalg.svd(start / np.where(lengths > 0, lengths, 1.0), full_matrices=False)
    left = left[:, sizes > _SEEN * sizes.max(initial=0.0)]
    return np.asarray(psi - left @ (left.T @ psi))


def _pseudo_inverse(R: Floats) -> Floats:
    """Of R'R, with columns of R scaled to one length; zero along unobserved directions."""
    lengths = np.linalg.norm(R, axis=0)
    lengths[lengths == 0] = 1.0
    _, sizes, rows = np.linalg.svd(R / lengths, full_matrices=False)
    seen = sizes > 1e-9 * sizes.max(initial=0.0)
    weighted = rows[seen] / sizes[seen, None]
    return np.asarray(weighted.T @ weighted / np.outer(lengths, lengths))


# --- How much more recursive estimates scatter than they would with white prediction errors ---------------------------


# Where the noise model is not right, neighbouring errors are correlated, and a sum of N of them is larger than
# sqrt(N) of one.  The standard deviations of the daemon come from lambda_0 P, so lambda_0 must be larger by this
# factor.


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
    end = len(free) + sum(map(len, varying.values()))  # number of parameters and slopes, before the delay
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
