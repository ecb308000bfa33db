"""The epoch of an axis: which nominal values are in force, and whether new ones are being learned or verified."""

from collections.abc import Iterable
from typing import Literal, NamedTuple

from monitor_core.monitoring import AxisStatus
from monitor_core.trend import EstimateReading, LearningWindow
from monitor_core.wording import duration

EpochPhase = Literal["learning", "verifying", "current"]


class AxisEpoch(NamedTuple):
    """The epoch of an axis at one moment, for API, metrics and page."""

    number: int = 1
    """Number of the epoch in force"""
    state: EpochPhase = "current"
    done_s: float | None = None
    """Operating time so far of the learning or verification window [s]; None: no window runs"""
    length_s: float | None = None
    """Operating time that the window needs [s]"""

    @property
    def complete(self) -> bool:
        """Whether the window has all the operating time that it needs."""
        return self.done_s is not None and self.length_s is not None and self.done_s >= self.length_s * (1 - 1e-9)

    @property
    def words(self) -> str:
        """Progress of the window in words; empty: no window runs."""
        if self.done_s is None or self.length_s is None:
            return ""
        done = duration(min(self.done_s, self.length_s)) if self.done_s else "nothing yet"
        return f"{self.state}: {done} of {duration(self.length_s)} of operation"


FIRST_EPOCH = AxisEpoch()


class Learning(NamedTuple):
    """A learning window, and the number of the epoch that will get its values."""

    number: int
    window: LearningWindow
    restarted: str = ""
    """Message that the window had to start again, as its state could not be restored; empty: it did not have to"""


class EpochProgress:
    """The epoch of an axis as the worker follows it; used by the worker's thread only.

    Args:
        number: number of the epoch in force.
        configured: whether its nominal values are those of the configuration.
    """

    def __init__(self, number: int, configured: bool) -> None:
        self.number, self._configured = number, configured
        self.verify_s: float | None = None
        """Operating time for which the epoch is verified [s]; None: the verification is over"""
        self.learning: Learning | None = None
        """The running learning window; None: none runs"""

    def key(self, key: str) -> str:
        """The key of a saved state, extended by the epoch that the state belongs to.

        An epoch with the configured values is not added: ``key`` already depends on these values.
        """
        return key if self._configured else f"epoch={self.number} {key}"

    def take(self, readings: Iterable[EstimateReading]) -> None:
        """Take readings of the axis."""
        if self.learning is not None:
            for reading in readings:
                self.learning.window.take(reading)

    def snapshot(self, status: AxisStatus) -> AxisEpoch:
        """The epoch now.  The progress of a verification is the longest time for which a parameter has been tested."""
        if self.learning is not None:
            window = self.learning.window
            return AxisEpoch(self.number, "learning", window.done_s, window.length_s)
        if self.verify_s is not None:
            tested_s = max((p.tested_s for p in status.parameters), default=0.0)
            return AxisEpoch(self.number, "verifying", tested_s, self.verify_s)
        return AxisEpoch(self.number)
