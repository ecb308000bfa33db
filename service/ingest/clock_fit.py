"""The clock of a controller as seen by this machine: a straight line through the times of receipt, followed slowly.

Frames are received late, never early: the smallest delay of many frames determines the line much better than any single
one.
"""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from typing import NamedTuple

SLEW = 150e-6
"""How fast sample times follow the receipt: two crystals rarely differ by more than 100 ppm."""

QUICK = 0.05
"""As fast where the line has just begun, with a frame that may have been late itself."""

MOST_RATE = 2000e-6
"""A fit that finds more than that is none: sample_interval_s is wrong."""

WINDOW_US = 10_000_000
"""The least delay of receipt within so long tells the drift: single frames may be late."""

TOLERANCE_US = 0.5e6
"""A frame further off the line than this, and than ten intervals, does not belong to it."""

PATIENCE_US = 1e6
"""After so long (or ten intervals) of nothing else the line restarts."""

_TELLING = 8
"""Windows that tell the rate."""


class Line:
    """Times of samples by their number: whole intervals from an anchor, shifted slowly.

    Args:
        interval_s: from one number to the next [s].
    """

    def __init__(self, interval_s: float) -> None:
        self.interval_us = interval_s * 1e6
        self.tolerance_us = max(TOLERANCE_US, 10 * self.interval_us)
        self._patience_us = max(PATIENCE_US, 10 * self.interval_us)
        self._anchor_us = 0
        self._off_since_us: int | None = None
        self.restarts = 0
        """How often it was restarted"""

    def begin(self, received_us: int) -> None:
        """Number 0 was received at that time."""
        self._anchor_us, self._off_since_us = received_us, None

    def nominal(self, n: int) -> int:
        """The time [us] of that number without any shift: one product, rounded once, so that no error accumulates."""
        return self._anchor_us + round(n * self.interval_us)

    def since_anchor(self, received_us: int) -> int:
        """Time [us] since number 0."""
        return received_us - self._anchor_us

    def on(self) -> None:
        """A frame fits."""
        self._off_since_us = None

    def off(self, received_us: int) -> bool:
        """A frame does not fit; returns whether nothing else has come for so long that the line must restart."""
        since_us = self._off_since_us
        if since_us is None or received_us < since_us:
            since_us = received_us
        self._off_since_us = since_us
        given_up = received_us - since_us >= self._patience_us
        self.restarts += given_up
        return given_up


class _Early(NamedTuple):
    over_us: float  # delay over the fit
    place_us: float
    delay_us: float


class Drift:
    """Delay of a line relative to its nominal course: the smallest delay of each window, or a fit through many windows.

    Args:
        window_us: length of a window along the line [us].
        keep: number of windows whose delays are fitted by a straight line; 1: the delay of the last one.
        most, part: of the ``most`` earliest frames of a window that quantile counts which is this part of all frames;
            the very earliest may have a wrong number.
        step_us: two consecutive windows that are off by more than this [us] are a step, and the fit restarts.
        rate: relative error of the interval, where that is known from before.
        quick: the line first follows early frames immediately, as the one it began with may have been late.
    """

    def __init__(
        self,
        window_us: float = WINDOW_US,
        keep: int = 1,
        most: int = 1,
        part: float = 0.0,
        step_us: float = math.inf,
        rate: float = 0.0,
        quick: bool = False,
    ) -> None:
        self._window_us, self._step_us, self._quick = window_us, step_us, quick
        self._most, self._part = most, part
        self._windows: deque[tuple[float, float]] = deque(maxlen=keep)  # place on the line, delay
        self._at_us, self._level_us, self.rate = 0.0, 0.0, rate
        self._known_rate = rate
        self._early: list[_Early] = []  # of this window, sorted
        self._seen = 0
        self._window_since_us = 0.0
        self._may_move_us = 0.0
        self._was_off = False
        self.shift_us = 0

    def expected(self, place_us: float) -> float:
        """The delay [us] of an early frame at that place of the line: by the windows before, at first by the frames."""
        fitted_us = self._fitted(place_us)
        return fitted_us + self._least.over_us if self.begins and self._early else fitted_us

    def see(self, place_us: float, delay_us: float) -> None:
        """Add a frame at that place of the line with that delay."""
        over_us = delay_us - self._fitted(place_us)
        self._seen += 1
        early = self._early
        if len(early) == self._most and over_us >= early[-1].over_us:
            return
        insort(early, _Early(over_us, place_us, delay_us))
        del early[self._most :]

    def follow(self, place_us: float, passed_us: float) -> int:
        """The shift [us] of the line at that place, which is limited from the last one on."""
        quick = self._quick and self.begins
        if not quick:
            self._close_if_full(place_us)
            self._move(round(self._fitted(place_us)), (SLEW + abs(self.rate)) * passed_us)
            return self.shift_us
        self._move(round(self.expected(place_us)), QUICK * passed_us)
        self._close_if_full(place_us)
        return self.shift_us

    def begin_again(self, place_us: float) -> None:
        """After a pause: the rate is known, the phase of the frames is not."""
        self._level_us, self._at_us = self._fitted(place_us), place_us
        self._forget()
        self._next_window(place_us)

    @property
    def settled(self) -> bool:
        """Whether the rate is based on enough windows."""
        return len(self._windows) > _TELLING

    @property
    def mean_rate(self) -> float | None:
        """As ``rate``, over all the time since the line began; None: that is too short."""
        return self._level_us / self._at_us if self._at_us > 2 * self._window_us else None

    @property
    def begins(self) -> bool:
        """Whether no window is full yet."""
        return not self._windows

    @property
    def _least(self) -> _Early:
        return self._early[min(len(self._early) - 1, int(self._part * self._seen))]

    def _fitted(self, place_us: float) -> float:
        return self._level_us + self.rate * (place_us - self._at_us)

    def _close_if_full(self, now_us: float) -> None:
        if now_us - self._window_since_us < self._window_us or not self._early:
            return
        over_us, place_us, delay_us = self._least
        self._next_window(now_us)
        if self._windows and abs(over_us) > self._step_us:
            if not self._was_off:
                self._was_off = True  # this machine may have been stalled
                return
            self._forget()
        self._was_off = False
        self._windows.append((place_us, delay_us))
        self._fit()

    def _next_window(self, since_us: float) -> None:
        self._early, self._seen, self._window_since_us = [], 0, since_us

    def _forget(self) -> None:
        self._windows.clear()
        self._known_rate = self.rate

    def _fit(self) -> None:
        """A line through the delays; two windows that are side by side say next to nothing of the rate."""
        count = len(self._windows)
        self._at_us = sum(place for place, _ in self._windows) / count
        self._level_us = sum(delay for _, delay in self._windows) / count
        if count == 1:
            return
        apart = [(place - self._at_us, delay - self._level_us) for place, delay in self._windows]
        known = (self._window_us / 4) ** 2
        slope = sum(p * d for p, d in apart) + known * self._known_rate
        rate = slope / (sum(p * p for p, _ in apart) + known)
        self.rate = max(-MOST_RATE, min(MOST_RATE, rate))

    def _move(self, wanted_us: int, most_us: float) -> None:
        error_us = wanted_us - self.shift_us
        self._may_move_us += most_us
        step_us = min(abs(error_us), int(self._may_move_us))
        self._may_move_us %= 1  # the fraction of a microsecond is carried over
        self.shift_us += step_us if error_us > 0 else -step_us
