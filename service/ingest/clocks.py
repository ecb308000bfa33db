"""The time of a sample on the clock of the controller: by a counter on the bus, or by its cycles alone.

Everything depends on counts and times of receipt alone, so a replay gives the same times.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Generic, Literal, NamedTuple, TypeVar

from service.ingest.clock_fit import Drift, Line

Rejected = Literal["repeated", "out_of_order", "untimed"]


class SampleClock:
    """Unwraps a sample counter and turns it into time: a straight line that slowly follows the times of receipt.

    The crystals of the controller and of this machine differ.  So the line is shifted, by at most 150 ppm of the
    elapsed time, towards the smallest recent delay.  Frames that are off the line by more than half a second (or ten
    intervals) are rejected as untimed; after a second (or ten intervals) of nothing else the line restarts: a clock was
    set, or the controller was restarted.  A host that was stalled and receives late is back on the line before that.

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


# --- controllers that send in cycles, without a counter -------------------------------------------------


WINDOW = 128
"""Cycles, of which the early frames tell where the line is: at 1000 ppm it moves an eighth of a cycle meanwhile."""

PART = 0.1
"""Of the frames are earlier than the line: the very earliest may be late ones that were given the next cycle."""

_MOST = int(PART * WINDOW) + 1

KEEP = 32
"""Windows through which the line goes."""

EARLY = 0.25
"""Part of a cycle by which a frame may be before the line; all other frames are late, by up to the rest at once."""

V = TypeVar("V")


class _Held(NamedTuple, Generic[V]):
    received_us: int
    cycle: int  # the last one that it can be of
    value: V


class CyclicClock(Generic[V]):
    """Fits phase and rate of the controller's clock to the times of receipt, and assigns a cycle to each frame.

    A frame is received after it was sent, so it belongs to the last cycle that had begun, unless it was late by more
    than a cycle.  This is ambiguous where cycles seem to be missing: frames were lost, or this machine was stalled and
    the waiting frames arrive in a burst.  Such a frame is held until one arrives at its usual distance; then those that
    arrived together belong to successive cycles, back from the last one, and cycles before them are missing.

    Frames that are not later than the last cycle are rejected as repeated or out of order; those further back than half
    a second (or ten cycles), and those that waited for longer, as untimed.  After a second of nothing but untimed
    frames the line restarts: the clock of this machine was set back.  After a pause of half a second the rate is kept,
    but not the phase; that counts as a restart, too: the clock may have been set forward.

    Args:
        interval_s: the cycle of the controller [s]; a difference of up to about 1000 ppm is found and followed.
    """

    def __init__(self, interval_s: float) -> None:
        self._line = Line(interval_s)
        self._most = math.ceil(self._line.tolerance_us / self._line.interval_us)
        self._drift: Drift | None = None
        self._n = 0  # of the last frame that was given a time
        self._received_us = 0  # of the last frame, but for untimed ones
        self._held: deque[_Held[V]] = deque()
        self._paused = False
        self._pauses = 0

    @property
    def reanchored(self) -> int:
        """How often the line, or its phase, was restarted."""
        return self._line.restarts + self._pauses

    @property
    def interval_s(self) -> float | None:
        """The cycle as fitted [s]; None: not known yet."""
        drift = self._drift
        return self._line.interval_us * (1 + drift.rate) * 1e-6 if drift and drift.settled else None

    def read(self, received_us: int, value: V) -> list[tuple[V, int | Rejected]]:
        """The values whose times [us] are known now, in order, or the reason why they have none.

        Args:
            received_us: when a frame was received [us].
            value: its content; it is returned now or later.
        """
        if self._drift is None:
            return [(value, self._anchor(received_us))]
        cycle = self._cycle(self._drift, received_us)
        newest = self._held[-1].cycle if self._held else self._n
        if cycle <= newest - self._most:
            return self._untimed(received_us, value)
        ready = self._caught_up(self._drift, received_us, cycle)
        if self._held or cycle > self._n + 1:
            return ready + self._hold(received_us, cycle, value)
        self._received_us = received_us
        if cycle <= self._n:
            return [*ready, (value, "repeated" if cycle == self._n else "out_of_order")]
        return [*ready, (value, self._give(self._drift, received_us, cycle))]

    def flush(self) -> list[tuple[V, int | Rejected]]:
        """End of the frames: the held values."""
        return [] if self._drift is None else self._release(self._drift)

    def _cycle(self, drift: Drift, received_us: int) -> int:
        """The last cycle that a frame received at that time can belong to."""
        place_us = self._line.since_anchor(received_us)
        return math.floor((place_us - drift.expected(place_us)) / self._line.interval_us + EARLY)

    def _caught_up(self, drift: Drift, received_us: int, cycle: int) -> list[tuple[V, int | Rejected]]:
        """The held frames, if this one is of a later cycle and did not wait with them."""
        waited = received_us - self._received_us < self._line.interval_us / 2
        if not self._held or waited or cycle <= self._held[-1].cycle:
            return []
        return self._release(drift)

    def _hold(self, received_us: int, cycle: int, value: V) -> list[tuple[V, int | Rejected]]:
        self._paused |= received_us - self._received_us > self._line.tolerance_us
        self._received_us = received_us
        self._held.append(_Held(received_us, cycle, value))
        self._line.on()
        if len(self._held) <= self._most:
            return []
        return [(self._held.popleft().value, "untimed")]

    def _release(self, drift: Drift) -> list[tuple[V, int | Rejected]]:
        """Frames that arrived together belong to successive cycles; the last one determines its own."""
        timed = list[tuple[_Held[V], int]]()
        after = math.inf
        while self._held:
            held = self._held.pop()
            after = min(held.cycle, after - 1)
            timed.append((held, int(after)))
        if self._paused:
            self._pauses, self._paused = self._pauses + 1, False
            place_us = timed[0][1] * self._line.interval_us
            drift.begin_again(place_us)
            drift.see(place_us, timed[0][0].received_us - self._line.nominal(timed[0][1]))
        return [(held.value, self._give_held(drift, held, n)) for held, n in reversed(timed)]

    def _give_held(self, drift: Drift, held: _Held[V], n: int) -> int | Rejected:
        if n <= self._n:
            return "repeated"
        if n == held.cycle:
            return self._give(drift, held.received_us, n)
        return self._time(drift, n)  # a frame that waited gives no information on the clock

    def _give(self, drift: Drift, received_us: int, n: int) -> int:
        self._line.on()
        drift.see(n * self._line.interval_us, received_us - self._line.nominal(n))
        return self._time(drift, n)

    def _time(self, drift: Drift, n: int) -> int:
        passed_us, self._n = (n - self._n) * self._line.interval_us, n
        return self._line.nominal(n) + drift.follow(n * self._line.interval_us, passed_us)

    def _untimed(self, received_us: int, value: V) -> list[tuple[V, int | Rejected]]:
        if not self._line.off(received_us):
            return [(value, "untimed")]
        return [*self.flush(), (value, self._anchor(received_us))]

    def _anchor(self, received_us: int) -> int:
        self._line.begin(received_us)
        rate = self._drift.rate if self._drift else 0.0
        interval_us = self._line.interval_us
        self._drift = Drift(WINDOW * interval_us, KEEP, _MOST, PART, interval_us / 4, rate, quick=True)
        self._drift.see(0.0, 0.0)
        self._n, self._received_us = 0, received_us
        return received_us
