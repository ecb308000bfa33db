"""The wall clock of this machine, watched for steps by comparison with a monotonic clock."""

from collections.abc import Callable
from time import monotonic

import structlog

from monitor_core.wording import duration, sentence
from service.texts.instants import iso, now_us

_STEP_US = 1_000_000
"""Smallest step; a smaller difference is a correction by NTP, or a delay between reading the two clocks"""
SHOWN_US = 7 * 86_400_000_000
"""How long a step is reported: a message that stays for months hides others"""

log = structlog.get_logger(__name__)


class WallClock:
    """Microseconds since 1970.  Call it several times a second, so that a step differs from slow corrections.

    Args:
        clock: wall clock, which may be set [us].
        steady: monotonic clock [s].
    """

    def __init__(self, clock: Callable[[], int] = now_us, steady: Callable[[], float] = monotonic) -> None:
        self._clock, self._steady = clock, steady
        self._before: tuple[int, int] | None = None
        self.set_by_us = 0
        """Sum of all steps since the first call [us]"""
        self._message: str | None = None
        self._set_at_us = 0
        """When it was set last, by the monotonic clock"""

    @property
    def message(self) -> str | None:
        """Message to the operator that the clock was set; None: it was not, or more than ``SHOWN_US`` ago."""
        if self._before is None or self._before[1] - self._set_at_us > SHOWN_US:
            return None
        return self._message

    def __call__(self) -> int:
        """The present time; a step since the last call is counted and logged."""
        now, steady = self._clock(), round(self._steady() * 1e6)
        before, self._before = self._before, (now, steady)
        if before is not None:
            step = (now - before[0]) - (steady - before[1])
            if abs(step) >= _STEP_US:
                self._report_step(step, now, steady)
        return now

    def _report_step(self, step_us: int, now: int, steady_us: int) -> None:
        self.set_by_us, self._set_at_us = self.set_by_us + step_us, steady_us
        way = "back" if step_us < 0 else "forward"
        self._message = sentence(
            "clock set back" if step_us < 0 else "clock set forward",
            "the clock of this machine was set {way} by {by}, to {at}. Alarms that were raised before are recorded with"
            " their true duration",
            way=way,
            by=duration(abs(step_us) * 1e-6),
            by_s=abs(step_us) * 1e-6,
            at=iso(now),
        )
        log.warning("the clock was set", by_s=step_us * 1e-6, now=iso(now))
