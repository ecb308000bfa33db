"""Uncertainty of the slope r of each hypothesis, from the uncertainty of the spectrum of the innovations.

g exceeds h at about the rate exp(-r h), where r is the root of the cumulant generating function of a log-likelihood
ratio (Lundberg).  The slope depends on the power S of the innovations e_0 at the frequencies that the hypothesis uses.
The innovations of the hypothesis are  e_i = (1 + F) e_0 + d:  its predictor filters the noise, and during motion it
differs by d, of power D.  For Gaussian noise, and innovations with the stated variances lambda and lambda_i, the
cumulant generating function at r is the mean over all frequencies of

    -log(1 - x) / 2 - r D / (2 lambda_i) + B / (1 - x) - r level,

x = r S (1 / lambda - |1 + F|^2 / lambda_i),  B = r^2 D S |1 + F|^2 / (2 lambda_i^2),  and the level is half of
log(lambda_i / lambda) plus the allowance.  With F = 0 and lambda_i = lambda, r is lambda times the mean of D over that
of D S; for hypotheses of more noise, r falls several times as fast with S.

The number of periodogram ordinates per frequency band grows with the length of the record (Priestley 1981, 6.2).  So r
is well known for a hypothesis that uses all frequencies, but not for an offset, which uses only those next to zero.
"""

from collections.abc import Callable, Iterable

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import bisected

_DOUBLINGS, _HALVINGS = 30, 60
_LEAST = 1e-9
_MAX_DEVIATION = 0.5
"""Largest standard deviation of log r: beyond it, log r is no linear function of the power."""


class Spectra:
    """Spectra of the innovations (N, 1 + H) of the reference and of each hypothesis, in segments of ``length`` samples.

    ``variance`` (1 + H,): stated variances of the innovations.  ``allowance`` (H,): subtracted from each log-likelihood
    ratio.
    """

    def __init__(self, variance: Floats, allowance: Floats, length: int) -> None:
        self._lam, self._lam_i = variance[0], variance[1:]
        self._level = np.log(self._lam_i / self._lam) / 2 + allowance
        self._length = length
        window = np.hanning(length + 2)[1:-1]
        self._window = window / np.sqrt(window @ window)
        frequencies, hypotheses = length // 2 + 1, len(allowance)
        self._bands = np.ones((frequencies, 1))
        self._bands[[0, -1]] = 0.5
        self._weight = self._bands / self._bands.sum()
        """Width of each frequency band, of which the first and the last count half; and its share"""
        self._eps = np.zeros((frequencies, 1))
        self._difference = np.zeros((frequencies, hypotheses))
        self._cross = np.zeros((frequencies, hypotheses), complex)
        self._samples = self._segments = 0

    def add(self, blocks: Iterable[Floats]) -> None:
        """Add a record, block by block; samples without a finite innovation are left out."""
        rest = np.zeros((0, len(self._level) + 1))
        for eps in blocks:
            kept = eps[np.isfinite(eps).all(axis=1)]
            self._samples += len(kept)
            rest = np.concatenate([rest, kept])
            segments = len(rest) // self._length
            for segment in rest[: segments * self._length].reshape(segments, self._length, rest.shape[1]):
                self._add_segment(segment)
            rest = rest[segments * self._length :]

    def _add_segment(self, segment: Floats) -> None:
        wave = np.fft.rfft(segment * self._window[:, np.newaxis], axis=0)
        own, difference = wave[:, :1], wave[:, 1:] - wave[:, :1]
        self._eps += np.abs(own) ** 2
        self._difference += np.abs(difference) ** 2
        self._cross += own.conj() * difference
        self._segments += 1

    def r(self) -> Floats:
        """Slope of each hypothesis (H,): 1 for an exact model; very large if there is never evidence for it."""
        D, slack, moved = self._parts()

        def cumulant(r: Floats) -> Floats:
            left = np.maximum(1 - r * slack, _LEAST)
            of_all = -np.log(left) / 2 - r * D / (2 * self._lam_i) + r**2 * moved / left
            return np.asarray((self._weight * of_all).sum(axis=0) - r * self._level)

        return _root(cumulant, 1 / np.maximum(slack.max(axis=0), _LEAST))

    def covariance(self) -> Floats:
        """Covariance of log r (H, H), with standard deviations limited to ``_MAX_DEVIATION``."""
        share = self._shares()
        own = (share / self._bands).T @ share * self._length / max(self._samples, 1)
        less = _MAX_DEVIATION / np.maximum(np.sqrt(np.diag(own)), _MAX_DEVIATION)
        return np.asarray(own * np.outer(less, less))

    def _shares(self) -> Floats:
        """Sensitivity of log r to the log of the power at each frequency (F, H), by implicit derivatives."""
        D, slack, moved = self._parts()
        r = self.r()
        x, B = r * slack, r**2 * moved
        left = np.maximum(1 - x, _LEAST)
        with_power = self._weight * (x / (2 * left) + B / left**2)
        with_r = self._weight * (x / (2 * left) - r * D / (2 * self._lam_i) + 2 * B / left + B * x / left**2)
        slope = with_r.sum(axis=0) - r * self._level
        return np.asarray(with_power / np.where(slope > _LEAST, slope, np.inf))

    def _parts(self) -> tuple[Floats, Floats, Floats]:
        """D, x and B of each frequency and hypothesis (F, H), at r = 1."""
        many = max(self._segments, 1)
        S, difference = np.maximum(self._eps / many, _LEAST * self._lam), self._difference / many
        # F has a chance part, from the random correlation with the motion: its expected value is subtracted.
        chance = difference * S / np.maximum(np.abs(self._cross) ** 2 / many, np.finfo(float).tiny)
        F = self._cross / many / S * np.maximum(1 - chance, 0.0)
        D, gain = np.maximum(difference - np.abs(F) ** 2 * S, 0.0), np.abs(1 + F) ** 2
        return D, S * (1 / self._lam - gain / self._lam_i), D * S * gain / (2 * self._lam_i**2)


def _root(f: Callable[[Floats], Floats], most: Floats) -> Floats:
    """Second root (H,), below ``most``, of convex functions that fall from 0 at 0; very large if there is none."""
    low, high = np.zeros_like(most), np.minimum(most, 1.0)
    for _ in range(_DOUBLINGS):
        high = np.where(f(high) < 0, np.minimum(2 * high, most), high)
    return bisected(lambda r: f(r) < 0, low, high, _HALVINGS)
