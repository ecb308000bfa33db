"""The time of a sample from a counter on the bus: whole intervals, without the jitter of receipt."""

from __future__ import annotations

from typing import Literal

from service.ingest.clock_fit import Drift, Line

Rejected = Literal["repeated", "out_of_order", "untimed"]


class SampleClock:
    """Unwraps a sample counter and turns it into time: a straight line that slowly follows the times of receipt.

    The crystals of the controller and of this machine differ.  So the line is shifted, by at most 150 ppm of the
    elapsed time, towards the smallest recent delay.  Frames that are off the line by more than half a second (or ten
    intervals) are rejected as untimed; after a second (or ten intervals) of nothing else the line restarts: a clock was
    set, or the controller was restarted.  A host that was stalled and receives late is back on the line before that.

    Everything depends on counts and times of receipt alone, so a replay gives the same times.

    Args:
        interval_s: the time of one count [s].
        bits: length of the counter; it wraps at 2^bits.
    """

    def __init__(self, interval_s: float, bits: int) -> None:
        self._modulus = 1 << bits
        self._line = Line(interval_s)
        self._drift: Drift | None = None
        self._n = 0  # of the last frame, also of an untimed one
        self._given_n = 0  # of the last time that was given
        self._raw = 0
        self._received_us = 0

    @property
    def reanchored(self) -> int:
        """How often counter and receipt diverged permanently, and the line was restarted."""
        return self._line.restarts

    @property
    def interval_s(self) -> float | None:
        """Measured time of one count since the line began [s]; None: not known yet."""
        rate = self._drift.mean_rate if self._drift else None
        return None if rate is None else self._line.interval_us * (1 + rate) * 1e-6

    def read(self, received_us: int, raw: int) -> int | Rejected:
        """The time [us] of the sample with this count, or why there is none.

        Args:
            received_us: when the frame with the count was received [us].
            raw: the count as it is on the bus.
        """
        drift = self._drift
        if drift is None:
            return self._anchor(received_us, raw)
        n = self._n + self._step(received_us, raw)
        line_us = self._line.nominal(n)
        delay_us = received_us - line_us
        if abs(delay_us - drift.shift_us) > self._line.tolerance_us:
            return self._untimed(received_us, raw, n)
        counts = n - self._given_n
        if counts <= 0:
            return "out_of_order" if counts else "repeated"
        self._line.on()
        self._given_n = n
        self._keep(received_us, raw, n)
        place_us = n * self._line.interval_us
        drift.see(place_us, delay_us)
        return line_us + drift.follow(place_us, counts * self._line.interval_us)

    def _step(self, received_us: int, raw: int) -> int:
        """Counts since the last frame: of all that fit the wrapped counter, the most likely by receipt."""
        expected = round((received_us - self._received_us) / self._line.interval_us)
        half = self._modulus // 2
        return expected - half + (raw - self._raw - expected + half) % self._modulus

    def _untimed(self, received_us: int, raw: int, n: int) -> int | Rejected:
        if self._line.off(received_us):
            return self._anchor(received_us, raw)
        self._keep(received_us, raw, n)
        return "untimed"

    def _keep(self, received_us: int, raw: int, n: int) -> None:
        self._received_us, self._raw, self._n = received_us, raw, n

    def _anchor(self, received_us: int, raw: int) -> int:
        self._line.begin(received_us)
        self._given_n, self._drift = 0, Drift()
        self._keep(received_us, raw, 0)
        return received_us
