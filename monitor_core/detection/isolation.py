"""Isolation of the changed parameter: likelihood ratios of single faults, with the full covariance of the estimates.

If only theta_i has changed, by delta, then d = theta - theta_0 has the mean delta e_i.  With V = cov(d) and R = V^-1

    T_i = (R d)_i^2 / R_ii        is twice the logarithm of the likelihood ratio, chi-square(1) if nothing has changed
    delta = (R d)_i / R_ii        +/- 1 / sqrt(R_ii), the likeliest size
    d' R d - T_i                  the part that a change of theta_i does not explain, chi-square(p - 1) if it is the
    cause

where V = lambda_0 P / (1 + lambda) for the estimates of the recursion.  The probabilities of the causes are exp(T_i /
2) times their prior odds (equal by default), normalized to the sum one.  A parameter that is known to have changed, by
any amount, is left out: only the elements of d and V of the other parameters are used.
"""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, chdtri  # importing scipy.stats instead takes seconds

from monitor_core.arrays import Floats

RIDGE = 1e-9
"""Added to the eigenvalues of a correlation matrix, so that it can be inverted for indistinguishable parameters too"""

MIN_TOLERANCE = 3.3
"""Standard deviations; one estimate in a thousand is farther off."""


class Causes(NamedTuple):
    """Evidence for each parameter (p,); parameters known to have changed have T = 0 and probability 0."""

    T: Floats  # (p,) chi-square
    size: Floats  # (p,) size of the change, if the parameter alone has changed
    size_sd: Floats  # (p,)
    probability: Floats  # (p,)
    rest: float
    """Chi-square of the deviations that the likeliest cause does not explain"""
    freedom: int
    """Degrees of freedom of ``rest``"""

    @property
    def best(self) -> int:
        """Index of the likeliest cause."""
        return int(self.probability.argmax())

    def explains(self, tolerance: float) -> bool:
        """Whether the most likely cause explains all deviations to within ``tolerance`` standard deviations."""
        return bool(self.rest <= limit(tolerance, self.freedom))

    def stands_out(self, tolerance: float) -> bool:
        """Whether the evidence for the likeliest cause exceeds ``tolerance`` standard deviations."""
        return bool(self.T[self.best] > limit(tolerance, 1))


def limit(tolerance: float, freedom: int) -> float:
    """The chi-square with the same tail probability as ``tolerance`` standard deviations."""
    if not freedom:
        return np.inf
    tail = chdtrc(1, max(tolerance, MIN_TOLERANCE) ** 2)
    return float(chdtri(freedom, tail)) if tail > 0 else np.inf


def single_faults(d: Floats, V: Floats, known: Collection[int] = (), prior: Floats | None = None) -> Causes:
    """Evidence for single causes of the deviations d (p,) with covariance V (p, p).

    ``known``: indices of parameters known to have changed.  ``prior`` (p,): prior odds, equal by default.
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
    """Sizes and standard deviations of the changes of the parameters ``changed``, if no others have changed."""
    R, scale = _information(V)
    J = list(changed)
    covariance = np.linalg.inv(R[np.ix_(J, J)])
    return scale[J] * (covariance @ (R @ (d / scale))[J]), scale[J] * np.sqrt(np.diag(covariance))


def _information(V: Floats) -> tuple[Floats, Floats]:
    """The inverse of V in units of its standard deviations, and these standard deviations.

    Without the units the inverse would be inexact, as parameters differ by many orders of magnitude.  For a diverging
    predictor, rounding may give V a direction of negative variance, which counts as zero.
    """
    scale = np.sqrt(np.diag(V))
    values, vectors = np.linalg.eigh(V / np.outer(scale, scale))
    return (vectors / (np.maximum(values, 0.0) + RIDGE)) @ vectors.T, scale
