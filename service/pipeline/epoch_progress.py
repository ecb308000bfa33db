"""The epoch of an axis: which nominal values are in force, and what is under way: learning new ones, verifying them."""

from collections.abc import Iterable
from typing import Literal, NamedTuple

from monitor_core.monitoring import AxisStatus
from monitor_core.trend import LearningWindow, Reading
from monitor_core.wording import duration

EpochPhase = Literal["learning", "verifying", "current"]


class AxisEpoch(NamedTuple):
    """The epoch of an axis at one moment, for API, metrics and page."""

    number: int = 1
    """Of the epoch that is in force"""
    state: EpochPhase = "current"
    done_s: float | None = None
    """Operating time of the window that is under way [s]; None: none is"""
    length_s: float | None = None
    """Operating time that it needs [s]"""

    @property
    def complete(self) -> bool:
        """Whether the window that is under way is over."""
        return (
            self.done_s is not None
            and self.length_s is not None
            and self.done_s >= self.length_s * (1 - 1e-9)
        )

    @property
    def words(self) -> str:
        """What is under way, for people; empty: nothing is."""
        if self.done_s is None or self.length_s is None:
            return ""
        done = duration(min(self.done_s, self.length_s)) if self.done_s else "nothing yet"
        return f"{self.state}: {done} of {duration(self.length_s)} of operation"


FIRST_EPOCH = AxisEpoch()


class Learning(NamedTuple):
    """A learning window, and the number of the epoch that it is for."""

    number: int
    window: LearningWindow
    again: str = ""
    """Message that nothing of it could be restored; empty: that is not so"""


class EpochProgress:
    """What the worker knows of the epoch of an axis; used by its thread only.

    Args:
        number: of the epoch that is in force.
        configured: its values are those of the configuration.
    """

    def __init__(self, number: int, configured: bool = True) -> None:
        self.number, self._configured = number, configured
        self.verify_s: float | None = None
        """Operating time for which it is verified [s]; None: it has been"""
        self.learning: Learning | None = None
        """The window that runs; None: none does"""

    def key(self, key: str) -> str:
        """The key of a saved state, with the epoch that it belongs to.

        Those with the values of the configuration have none: the key itself says whether these are the same.
        """
        return key if self._configured else f"epoch={self.number} {key}"

    def take(self, readings: Iterable[Reading]) -> None:
        """Take readings of the axis."""
        if self.learning is not None:
            for reading in readings:
                self.learning.window.take(reading)

    def shown(self, status: AxisStatus) -> AxisEpoch:
        """The epoch now.  It is verified for as long as any of its parameters has been tested since it began."""
        if self.learning is not None:
            window = self.learning.window
            return AxisEpoch(self.number, "learning", window.done_s, window.length_s)
        if self.verify_s is not None:
            tested_s = max((p.tested_s for p in status.parameters), default=0.0)
            return AxisEpoch(self.number, "verifying", tested_s, self.verify_s)
        return AxisEpoch(self.number)
