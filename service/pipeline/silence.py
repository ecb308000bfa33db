"""Axes whose samples have stopped: since when, with one line in the log when they stop and one when they are back.

Ages are measured by a monotonic clock, as the clock of the machine may be set meanwhile.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from time import monotonic

import structlog

from monitor_core.wording import duration, first_of
from service.can.bus_reader import BusSnapshot
from service.pipeline.snapshot import AxisSnapshot, Snapshot
from service.texts.instants import iso

SILENT_S = 5.0
SILENT_INTERVALS = 10
"""An axis is silent if its last sample was received longer ago than both."""

RETURNED_S = 5.0
LONGEST_RETURNED_S = 3600.0
"""The log says that an axis is back when it has been received for ``RETURNED_S``.  That time is doubled with each
silence within an hour after the last one, up to ``LONGEST_RETURNED_S``: a loose contact must not fill the log."""

_MOST_NAMES = 20
"""Most axes that are named in a line"""
_SAME_US = 2_000_000
"""Largest difference between the time of the last sample and that of its receipt, unless a clock was set [us]"""

log = structlog.get_logger(__name__)


def silent_after_s(interval_s: float) -> float:
    """The age of the last sample [s] from which an axis with this sample interval [s] is silent."""
    return max(SILENT_S, SILENT_INTERVALS * interval_s)


class _LastSample:
    """The samples of an axis as received; times [s] are those of the monotonic clock.

    Args:
        time_us: time of its last sample; None: there was none.
        received_s: when that was received, or when the axis was first seen.
    """

    def __init__(self, time_us: int | None, received_s: float) -> None:
        self.time_us, self.received_s = time_us, received_s
        self.since_us: int | None = None
        """Since when it is silent, by the clock of the machine; None: it is not"""
        self.again_s = received_s
        """When the first sample after the last silence was received"""
        self.received: tuple[AxisSnapshot, BusSnapshot] | None = None
        """The axis and its bus when the last sample was received"""
        self.logged_s: float | None = None
        """When the silence that the log reports began; None: the log reports its end, too"""
        self.back_s: float | None = None
        """When the log reported the end of the last silence"""
        self.hold_s = RETURNED_S
        """Time without a silence after which the axis is back"""

    def take(self, time_us: int, now_s: float) -> None:
        """A sample has been received."""
        if self.since_us is not None or self.time_us is None:
            self.again_s = now_s
        self.time_us, self.received_s, self.since_us = time_us, now_s, None

    def fall_silent(self, now_s: float) -> None:
        """Note that the log reports the beginning of a silence."""
        often = self.back_s is not None and now_s - self.back_s < LONGEST_RETURNED_S
        self.hold_s = min(2 * self.hold_s, LONGEST_RETURNED_S) if often else RETURNED_S
        self.logged_s = self.received_s

    def is_back(self, now_s: float) -> bool:
        """Whether the end of a silence belongs in the log now."""
        return self.logged_s is not None and now_s - self.again_s >= self.hold_s


class SilenceWatch:
    """Watches the samples of all axes, in the worker's thread.

    Args:
        frames: names of the messages from which the samples of an axis are made, by its id.
        steady: monotonic clock [s].
    """

    def __init__(self, frames: Callable[[str], Iterable[str]], steady: Callable[[], float] = monotonic) -> None:
        self._frames, self._steady = frames, steady
        self._known = dict[str, _LastSample]()
        self._from_s = steady()
        """Since when frames are taken: the log reports no silence before"""

    def since(self, axis_id: str, interval_s: float, time_us: int | None, now_us: int) -> int | None:
        """Since when an axis that had samples is silent, by the present clock of the machine [us]; None: it is not.

        Args:
            axis_id: the axis.
            interval_s: its sample interval [s].
            time_us: time of its last sample; None: there is none.
            now_us: the present time.
        """
        now_s = self._steady()
        if (seen := self._known.get(axis_id)) is None:
            # The last sample of a restored axis is older than the daemon.
            age_s = 0.0 if time_us is None else max(0, now_us - time_us) / 1e6
            seen = self._known[axis_id] = _LastSample(time_us, now_s - age_s)
        elif time_us is not None and time_us != seen.time_us:
            seen.take(time_us, now_s)
        silent_s = now_s - seen.received_s
        if time_us is not None and silent_s > silent_after_s(interval_s):
            by_age_us = now_us - round(silent_s * 1e6)
            shown_us = time_us if seen.since_us is None else seen.since_us
            seen.since_us = shown_us if abs(shown_us - by_age_us) <= _SAME_US else by_age_us
        return seen.since_us

    def report(self, snapshot: Snapshot, takes: bool) -> None:
        """Log which axes have become silent and which are back, in one line for each bus.

        Args:
            snapshot: the newest snapshot, of axes for which ``since`` was called.
            takes: whether frames are taken; they wait while the kernel is compiled.
        """
        now_s = self._steady()
        if not takes:
            self._from_s = now_s
            return
        self._known = {axis.id: self._known[axis.id] for axis in snapshot.axes}
        for bus in snapshot.buses:
            silent, back = list[AxisSnapshot](), list[AxisSnapshot]()
            for axis in (axis for axis in snapshot.axes if axis.bus == bus.name):
                seen, limit_s = self._known[axis.id], silent_after_s(axis.interval_s)
                if now_s - seen.received_s <= limit_s:
                    if seen.received is None or seen.received[0].status.time_us != axis.status.time_us:
                        seen.received = axis, bus
                    if seen.is_back(now_s):
                        back.append(axis)
                elif seen.logged_s is None and now_s - self._from_s > limit_s:
                    silent.append(axis)
            if silent:
                self._log_silent(silent, bus, now_s)
            if back:
                self._log_back(back, bus, now_s)

    def _log_silent(self, axes: Sequence[AxisSnapshot], bus: BusSnapshot, now_s: float) -> None:
        lost, begun = Counter[str](), list[int]()
        for axis in axes:
            seen = self._known[axis.id]
            seen.fall_silent(now_s)
            lost |= _dropped(axis, bus) - (Counter() if seen.received is None else _dropped(*seen.received))
            begun += [] if seen.since_us is None else [seen.since_us]
        log.warning(
            "axes without samples",
            axes=_names(axis.id for axis in axes),
            since=iso(min(begun)) if begun else "the start",
            frames=_names(name for axis in axes for name in self._frames(axis.id)),
            bus=bus.name,
            bus_state=bus.state,
            **({"dropped": dict(lost)} if lost else {}),
        )

    def _log_back(self, axes: Sequence[AxisSnapshot], bus: BusSnapshot, now_s: float) -> None:
        silent_s = 0.0
        for axis in axes:
            seen = self._known[axis.id]
            silent_s = max(silent_s, seen.again_s - (seen.logged_s or 0.0))
            seen.logged_s, seen.back_s = None, now_s
        log.info(
            "axes with samples again",
            axes=_names(axis.id for axis in axes),
            bus=bus.name,
            silent_for=duration(silent_s),
        )


def _dropped(axis: AxisSnapshot, bus: BusSnapshot) -> Counter[str]:
    """Values of an axis and frames of its bus that were dropped, by reason."""
    return Counter(axis.dropped) + Counter(bus.dropped)


def _names(names: Iterable[str]) -> str:
    return first_of(list(dict.fromkeys(names)), _MOST_NAMES)
