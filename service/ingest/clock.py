"""The time of a sample from a counter on the bus: whole intervals, free of the jitter of receipt."""

from __future__ import annotations

from typing import Literal

Rejected = Literal["repeated", "out_of_order", "untimed"]

SLEW = 150e-6
"""How fast sample times follow the receipt: two crystals rarely differ by more than 100 ppm."""

WINDOW_US = 10_000_000
"""The least delay of receipt within so long tells the drift: single frames may be late."""


class SampleClock:
    """Unwraps a sample counter and turns it into time: a straight line that slowly follows the receipt.

    The crystals of the controller and of this machine differ, so the line is shifted, by no more than 150 ppm
    of the time that passes, towards the smallest delay of late.  Frames that are off the line by more than
    half a second (or ten intervals) are rejected as untimed; after a second (or ten intervals) of nothing else
    the line starts anew: a clock was set, or the controller has started again.  A host that was held up and
    receives late is back on the line before that.

    All of it depends on counts and times of receipt alone, so a replay gives the same times.

    Args:
        interval_s: what one count stands for [s].
        bits: length of the counter; it wraps at 2^bits.
    """

    def __init__(self, interval_s: float, bits: int) -> None:
        self._interval_us = interval_s * 1e6
        self._modulus = 1 << bits
        self._tolerance_us = max(0.5e6, 10 * self._interval_us)
        self._patience_us = max(1e6, 10 * self._interval_us)
        self._anchor_us: int | None = None
        self._n = 0  # of the last frame, also of an untimed one
        self._given_n = 0  # of the last time that was given
        self._raw = 0
        self._received_us = 0
        self._untimed_since_us: int | None = None
        self._drift = _Drift()
        self.reanchored = 0
        """How often counter and receipt diverged for good, and the line was started anew"""

    def read(self, received_us: int, raw: int) -> int | Rejected:
        """The time [us] of the sample with this count, or why there is none.

        Args:
            received_us: when the frame with the count was received [us].
            raw: the count as it is on the bus.
        """
        if self._anchor_us is None:
            return self._anchor(received_us, raw)
        n = self._n + self._step(received_us, raw)
        # One product, rounded once: no error adds up however long the run.
        line_us = self._anchor_us + round(n * self._interval_us)
        delay_us = received_us - line_us
        if abs(delay_us - self._drift.shift_us) > self._tolerance_us:
            return self._untimed(received_us, raw, n)
        counts = n - self._given_n
        if counts <= 0:
            return "out_of_order" if counts else "repeated"
        self._untimed_since_us = None
        self._given_n = n
        self._keep(received_us, raw, n)
        return line_us + self._drift.follow(counts * self._interval_us, delay_us)

    def _step(self, received_us: int, raw: int) -> int:
        """Counts since the last frame: of all that fit the wrapped counter, the likeliest by receipt."""
        expected = round((received_us - self._received_us) / self._interval_us)
        half = self._modulus // 2
        return expected - half + (raw - self._raw - expected + half) % self._modulus

    def _untimed(self, received_us: int, raw: int, n: int) -> int | Rejected:
        since_us = self._untimed_since_us
        if since_us is None or received_us < since_us:
            since_us = received_us
        self._untimed_since_us = since_us
        if received_us - since_us >= self._patience_us:
            self.reanchored += 1
            return self._anchor(received_us, raw)
        self._keep(received_us, raw, n)
        return "untimed"

    def _keep(self, received_us: int, raw: int, n: int) -> None:
        self._received_us, self._raw, self._n = received_us, raw, n

    def _anchor(self, received_us: int, raw: int) -> int:
        self._anchor_us, self._given_n = received_us, 0
        self._untimed_since_us, self._drift = None, _Drift()
        self._keep(received_us, raw, 0)
        return received_us


class _Drift:
    """Follows the smallest delay of each window, so slowly that an interval hardly changes."""

    def __init__(self) -> None:
        self.shift_us = 0
        self._wanted_us = 0
        self._least_us: int | None = None
        self._passed_us = 0.0  # since the window began
        self._may_move_us = 0.0

    def follow(self, passed_us: float, delay_us: int) -> int:
        """The shift [us] of the line after so much more time, at a frame with that delay."""
        self._least_us = delay_us if self._least_us is None else min(self._least_us, delay_us)
        self._passed_us += passed_us
        if self._passed_us >= WINDOW_US:
            self._wanted_us, self._least_us, self._passed_us = self._least_us, None, 0.0
        self._move(passed_us)
        return self.shift_us

    def _move(self, passed_us: float) -> None:
        error_us = self._wanted_us - self.shift_us
        self._may_move_us += SLEW * passed_us
        step_us = min(abs(error_us), int(self._may_move_us))
        self._may_move_us %= 1  # only what is less than a microsecond is kept for the next time
        self.shift_us += step_us if error_us > 0 else -step_us
