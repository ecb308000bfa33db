"""The slow histories of an axis: readings in, and of which parameters there is enough that is new to look again."""

from collections.abc import Sequence

from monitor_core.trend.entries import Reading
from monitor_core.trend.slow_history import HOUR_S, SlowHistory

AGAIN = 50
"""A history is looked at again when it has grown by this part of it."""


class AxisHistory:
    """The slow history of each monitored parameter of one axis.

    Args:
        names: of the monitored parameters.
        hour_s: time in operation [s] of an entry.
    """

    def __init__(self, names: Sequence[str], hour_s: float = HOUR_S) -> None:
        self.names = tuple(names)
        self.slow = tuple(SlowHistory(hour_s) for _ in self.names)
        self.closed = [0] * len(self.names)
        """Entries that have been closed since the start, of each"""
        self._looked = [0] * len(self.names)

    def take(self, r: Reading) -> None:
        """Take a reading; a parameter that is not known then has none."""
        for i, slow in enumerate(self.slow):
            if r.known[i]:
                self.closed[i] += slow.take(r.time_us, r.value[i], r.variance[i], r.span_s, r.correlation)

    def due(self) -> list[int]:
        """The parameters whose histories are to be looked at again."""
        return [i for i in range(len(self.names)) if self._grown(i)]

    def look(self, i: int) -> None:
        """From now on the history of parameter i counts as looked at."""
        self._looked[i] = self.closed[i]

    def look_again(self) -> None:
        """All that there is, is to be looked at, as after a restart."""
        self._looked = [-1] * len(self.names)

    def _grown(self, i: int) -> bool:
        if self._looked[i] < 0:
            return bool(self.slow[i].entries)
        new = self.closed[i] - self._looked[i]
        return new > 0 and new * AGAIN >= len(self.slow[i].entries)
