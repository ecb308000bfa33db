"""The clock of this machine, which people and NTP set: how far, compared with a time that only goes on."""

from collections.abc import Callable
from time import monotonic

import structlog

from monitor_core.wording import duration, sentence
from service.texts.instants import iso, now_us

_STEP_US = 1_000_000
"""Less is NTP that corrects a little, or a wait between the two clocks"""

log = structlog.get_logger(__name__)


class WallClock:
    """Microseconds since 1970, to be asked several times a second, so that a step is told from slow corrections.

    Args:
        clock: that may be set [us].
        steady: that cannot be [s].
    """

    def __init__(self, clock: Callable[[], int] = now_us, steady: Callable[[], float] = monotonic) -> None:
        self._clock, self._steady = clock, steady
        self._before: tuple[int, int] | None = None
        self.set_by_us = 0
        """How far it was set since the first call, all steps together"""
        self.message: str | None = None
        """That it was set, for the operator; None: it was not"""

    def __call__(self) -> int:
        """The time now; a step since the last call is logged."""
        now, steady = self._clock(), round(self._steady() * 1e6)
        before, self._before = self._before, (now, steady)
        if before is not None:
            step = (now - before[0]) - (steady - before[1])
            if abs(step) >= _STEP_US:
                self._was_set(step, now)
        return now

    def _was_set(self, step_us: int, now: int) -> None:
        self.set_by_us += step_us
        way = "back" if step_us < 0 else "forward"
        self.message = sentence(
            "clock set back" if step_us < 0 else "clock set forward",
            "the clock of this machine was set {way} by {by}, to {at}. Alarms that were raised before are recorded with"
            " their true duration",
            way=way,
            by=duration(abs(step_us) * 1e-6),
            by_s=abs(step_us) * 1e-6,
            at=iso(now),
        )
        log.warning("the clock was set", by_s=step_us * 1e-6, now=iso(now))
