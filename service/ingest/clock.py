"""The time of a sample from a counter on the bus: whole intervals, free of the jitter of receipt."""

from __future__ import annotations

from typing import Literal

Rejected = Literal["repeated", "out_of_order"]


class SampleClock:
    """Unwraps a sample counter and turns it into time: anchor + n * interval.

    Args:
        interval_s: what one count stands for [s].
        bits: length of the counter; it wraps at 2^bits.
    """

    def __init__(self, interval_s: float, bits: int) -> None:
        self._interval_us = interval_s * 1e6
        self._modulus = 1 << bits
        self._tolerance_us = max(0.5e6, 10 * self._interval_us)
        self._anchor_us: int | None = None
        self._n = 0
        self._raw = 0
        self._received_us = 0
        self.reanchored = 0
        """How often counter and receipt diverged by more than half a second (or ten intervals)"""

    def read(self, received_us: int, raw: int) -> int | Rejected:
        """The time [us] of the sample with this count, or why there is none.

        Args:
            received_us: when the frame with the count was received [us].
            raw: the count as it is on the bus.
        """
        if self._anchor_us is None:
            return self._anchor(received_us, raw)
        step = self._step(received_us, raw)
        # One product, rounded once: no drift however long the run.
        time_us = self._anchor_us + round((self._n + step) * self._interval_us)
        if abs(time_us - received_us) > self._tolerance_us:
            self.reanchored += 1
            return self._anchor(received_us, raw)
        if step <= 0:
            return "out_of_order" if step else "repeated"
        self._n += step
        self._raw, self._received_us = raw, received_us
        return time_us

    def _step(self, received_us: int, raw: int) -> int:
        """Counts since the last sample: of all that fit the wrapped counter, the likeliest by receipt."""
        expected = round((received_us - self._received_us) / self._interval_us)
        half = self._modulus // 2
        return expected - half + (raw - self._raw - expected + half) % self._modulus

    def _anchor(self, received_us: int, raw: int) -> int:
        self._anchor_us, self._n = received_us, 0
        self._raw, self._received_us = raw, received_us
        return received_us
