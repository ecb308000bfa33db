"""Which parameter has changed: likelihood ratios of single faults, with the full covariance of the estimates.

If only theta_i has changed, by delta, then d = theta - theta_0 has the mean delta e_i.  With V = cov(d) and R = V^-1

    T_i = (R d)_i^2 / R_ii        is twice the logarithm of the likelihood ratio, chi-square(1) if nothing has changed
    delta = (R d)_i / R_ii        +/- 1 / sqrt(R_ii), the likeliest size
    d' R d - T_i                  what a change of theta_i leaves unexplained, chi-square(p - 1) if it is the cause

(with V = lambda_0 P / (1 + lambda) this is the T_i of the CUSUM's own parameters).  exp(T_i / 2), made to sum to one,
are the probabilities of the causes, by their odds beforehand, or each being as likely as any other.  A change that is
known already, of any size, is left out together with its parameter: what remains of d and V is that of the others.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri  # not scipy.stats: to import that takes seconds

from monitor_core.arrays import Floats

RIDGE = 1e-9
"""Beside a correlation of one: what cannot be distinguished at all stays a matrix that can be inverted."""

LEAST_TOLERANCE = 3.3
"""Standard deviations; one estimate in a thousand is farther off."""


class Causes(NamedTuple):
    """Evidence for each parameter, in their order; those known before have T = 0 and probability 0."""

    T: Floats  # (p,) chi-square
    size: Floats  # (p,) if it alone has changed
    size_sd: Floats  # (p,)
    probability: Floats  # (p,)
    rest: float
    """Chi-square of what the likeliest cause leaves unexplained"""
    freedom: int
    """Its degrees of freedom"""

    @property
    def best(self) -> int:
        """The likeliest."""
        return int(self.probability.argmax())

    def explains(self, tolerance: float) -> bool:
        """Whether the most likely cause explains all deviations to within ``tolerance`` standard deviations."""
        return bool(self.rest <= limit(tolerance, self.freedom))

    def stands_out(self, tolerance: float) -> bool:
        """Whether there is anything to be explained."""
        return bool(self.T[self.best] > limit(tolerance, 1))


def limit(tolerance: float, freedom: int) -> float:
    """The chi-square with the same tail probability as ``tolerance`` standard deviations."""
    if not freedom:
        return np.inf
    tail = chdtrc(1, max(tolerance, LEAST_TOLERANCE) ** 2)
    return float(chdtri(freedom, tail)) if tail > 0 else np.inf


def single_faults(d: Floats, V: Floats, known: Collection[int] = (), prior: Floats | None = None) -> Causes:
    """Evidence for single causes of d (p,) of covariance V (p, p), given those known.

    ``prior`` (p,) are the prior odds, equal by default.
    """
    p = len(d)
    rest = [i for i in range(p) if i not in known]
    T, size, size_sd, probability = np.zeros(p), np.zeros(p), np.full(p, np.inf), np.zeros(p)
    if not rest:
        return Causes(T, size, size_sd, probability, 0.0, 0)
    R, scale = _information(V[np.ix_(rest, rest)])
    e = d[rest] / scale
    Rd, R_ii = R @ e, np.diag(R)
    T[rest], size[rest], size_sd[rest] = Rd**2 / R_ii, scale * Rd / R_ii, scale / np.sqrt(R_ii)
    logs = T[rest] / 2 + (0.0 if prior is None else np.log(prior[rest]))
    weight = np.exp(logs - logs.max())
    probability[rest] = weight / weight.sum()
    return Causes(T, size, size_sd, probability, float(e @ Rd - T[probability.argmax()]), len(rest) - 1)


def sizes(d: Floats, V: Floats, changed: Sequence[int]) -> tuple[Floats, Floats]:
    """Sizes and standard deviations of the ``changed`` parameters, if no others have changed."""
    R, scale = _information(V)
    J = list(changed)
    covariance = np.linalg.inv(R[np.ix_(J, J)])
    return scale[J] * (covariance @ (R @ (d / scale))[J]), scale[J] * np.sqrt(np.diag(covariance))


def _information(V: Floats) -> tuple[Floats, Floats]:
    """The inverse of V in units of its standard deviations, and these; parameters differ by many orders of magnitude.

    Rounding may leave V, of a diverging predictor, with a direction of negative variance.
    """
    scale = np.sqrt(np.diag(V))
    values, vectors = np.linalg.eigh(V / np.outer(scale, scale))
    return (vectors / (np.maximum(values, 0.0) + RIDGE)) @ vectors.T, scale
