"""How well a finite record knows the power of the innovations where each hypothesis looks at them.

What a hypothesis says of a sample is, but for a square, e_0 (e_i - e_0): how far its g goes hangs on the power of the
innovations at the frequencies of that difference.  A record knows the power at each frequency from as many periodogram
ordinates as it is long (Priestley 1981, 6.2): a hypothesis that looks at all frequencies knows it well, an offset at
those next to zero.
"""

import numpy as np

from monitor_core.kernel.tables import Floats


class Spectra:
    """Of innovations (N, 1 + H), of what holds and of each hypothesis, in segments of so many samples."""

    def __init__(self, hypotheses: int, length: int) -> None:
        self._length, self._window = length, np.hanning(length + 2)[1:-1]
        self._eps = np.zeros((length // 2 + 1, 1))
        self._difference = np.zeros((length // 2 + 1, hypotheses))
        self._samples = 0

    def add(self, eps: Floats) -> None:
        """Of one record; samples without a finite innovation are left out."""
        kept = eps[np.isfinite(eps).all(axis=1)]
        segments = len(kept) // self._length
        for one in kept[: segments * self._length].reshape(segments, self._length, -1):
            windowed = one * self._window[:, np.newaxis]
            self._eps += np.abs(np.fft.rfft(windowed[:, :1], axis=0)) ** 2
            self._difference += np.abs(np.fft.rfft(windowed[:, 1:] - windowed[:, :1], axis=0)) ** 2
        self._samples += len(kept)

    def covariance(self) -> Floats:
        """Of the logarithms of the powers (H, H); nothing is known of those that never differ."""
        looked_at = self._eps * self._difference
        looked_at[0] /= 2  # half of its band is below zero, and the same again
        whole = looked_at.sum(axis=0)
        share = looked_at / np.where(whole > 0, whole, 1.0)
        share[0] *= np.sqrt(2)
        return np.asarray(share.T @ share * self._length / max(self._samples, 1))
