"""Records the estimates of all axes to the history.  Points wait in memory, and a separate thread writes them.

The worker only appends points, so a slow, full, locked or damaged disk does not delay it.
"""

import math
import threading
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping
from time import monotonic, time
from typing import NamedTuple

import structlog

from monitor_core.monitoring import AxisStatus, NotTested, Observation, ParameterStatus, Status
from monitor_core.wording import sentence
from service.store.database import StoreError
from service.store.history_store import HistoryPoint, HistorySeries, HistoryStore

POINTS_AT_ONCE = 6
"""Points of each parameter in a transaction.  Each transaction writes a page of the file for each parameter and
resolution, so few large ones cost less."""
CHECKS_PER_INTERVAL = 20
"""Number of times in an interval at which a point is looked for, while there are no estimates."""
LONGEST_WAIT_S = 600.0
"""Longest time before points are written."""
RETRY_S = 10.0
FRESH_S = 0.5
"""Longest time that a reader waits for the points that it has asked to be written"""
MOST_WAITING = 200_000
"""Most points that wait while the disk refuses them, about 60 MB: 30 hours of 18 parameters with a point each 10 s."""
OBSERVABILITY: Mapping[Observation, float] = {
    Observation.OBSERVED: 1.0,
    Observation.WEAK: 0.5,
    Observation.UNSEEN: 0.0,
}
_LEARNING = (Status.WAITING, Status.SETTLING, Status.SEEDING, Status.INVALID)

FULL = "memory full"
"""Reason for dropped points: too many wait"""

log = structlog.get_logger(__name__)


class HistoryState(NamedTuple):
    """State of the history writer.

    ``problem``: message to the operator why points wait; None: none wait on a fault.
    """

    waiting: int = 0
    dropped: Mapping[str, int] = {FULL: 0}
    problem: str | None = None
    messages: tuple[str, ...] = ()


NO_HISTORY = HistoryState()


class HistoryRecording:
    """Records one point of each parameter in each interval.

    Args:
        open_store: opens the file; called by the writer's thread, and again after a failure.
        interval_s: time between two points of a parameter [s].
        clock: monotonic clock, for the time between two writes [s].
        now_s: wall clock, to tell which points are too old [s since 1970].
        most_waiting: most points that wait; more drop the oldest.
    """

    def __init__(
        self,
        open_store: Callable[[], HistoryStore],
        interval_s: float,
        clock: Callable[[], float] = monotonic,
        now_s: Callable[[], float] = time,
        most_waiting: int = MOST_WAITING,
    ) -> None:
        self._open, self.interval_s, self._clock, self._now_s = open_store, interval_s, clock, now_s
        self._most_waiting = most_waiting
        self._slots: dict[str, int] = {}
        self._looked_us: dict[str, int] = {}
        """By axis: time of the sample at which a point was last looked for"""
        self._waiting = deque[HistoryPoint]()
        self._lock = threading.Lock()
        self._dropped = Counter({FULL: 0})
        self._next_try = -math.inf
        self._write_began_s = -math.inf
        self._stop, self._wake, self._done = threading.Event(), threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="history", daemon=True)
        self.store: HistoryStore | None = None
        """The file, once it is open"""
        self._problem: str | None = None
        self._messages: tuple[str, ...] = ()

    # --- the worker's side --------------------------------------------------------------------------------

    def is_due(self, axis_id: str, time_us: int | None) -> bool:
        """Whether to call ``take`` for an axis whose last sample has this time.

        While the axis has no estimates, this is so ``CHECKS_PER_INTERVAL`` times in each interval.
        """
        if time_us is None or self._slots.get(axis_id) == self._slot(time_us):
            return False
        looked_us = self._looked_us.get(axis_id)
        return looked_us is None or abs(time_us - looked_us) >= self.interval_s * 1e6 / CHECKS_PER_INTERVAL

    def take(self, axis_id: str, status: AxisStatus, paused: bool) -> None:
        """Keep a point of each parameter, for an axis for which ``is_due`` is true.

        A parameter without a present estimate gets no point: settling, invalid, or the axis is ``paused``.
        """
        assert status.time_us is not None  # otherwise none is due
        self._looked_us[axis_id], slot = status.time_us, self._slot(status.time_us)
        t = math.floor(slot * self.interval_s)
        found = [] if paused else [_point(axis_id, t, p) for p in status.parameters if _is_known(p)]
        if not found:  # estimates may become available later in this interval
            return
        self._slots[axis_id] = slot
        with self._lock:
            self._waiting.extend(found)
            self._drop_oldest()

    def keep_only(self, axis_ids: Collection[str]) -> None:
        """Forget all other axes, which were removed; their points that wait are still written."""
        self._slots = {axis_id: slot for axis_id, slot in self._slots.items() if axis_id in axis_ids}
        self._looked_us = {axis_id: t_us for axis_id, t_us in self._looked_us.items() if axis_id in axis_ids}

    def _slot(self, time_us: int) -> int:
        return math.floor(time_us / (self.interval_s * 1e6))

    def state(self) -> HistoryState:
        """The present state of the writer."""
        with self._lock:
            return HistoryState(len(self._waiting), dict(self._dropped), self._problem, self._messages)

    def start(self) -> None:
        """Start the writer's thread."""
        self._thread.start()

    def stop(self) -> None:
        """Write the waiting points, if the disk takes them now, and close the file."""
        self._stop.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()
        if self.store is not None:
            self.store.close()

    # --- a reader's side ----------------------------------------------------------------------------------

    def freshen(self) -> None:
        """Let the waiting points be written now, at most once per interval; wait up to ``FRESH_S`` for a slow disk."""
        with self._lock:
            recent = self._clock() - self._write_began_s < self.interval_s
            if recent or not self._waiting or not self._thread.is_alive():
                return
            done = self._done
        self._wake.set()
        done.wait(FRESH_S)

    # --- the writer's side --------------------------------------------------------------------------------

    def write(self) -> None:
        """Write the waiting points, unless the last try failed less than ``RETRY_S`` ago."""
        if self._clock() < self._next_try:
            return
        with self._lock:
            self._write_began_s = self._clock()
            found = list(self._waiting)
            self._waiting.clear()
        try:
            store = self._open_store()
            store.add(found)
        except StoreError as error:
            with self._lock:
                self._waiting.extendleft(reversed(found))
                self._drop_oldest()
            self._report(error)
            return
        self._end_problem()
        try:
            store.prune(self._now_s())
        except StoreError as error:
            self._report(error)

    def _run(self) -> None:
        wait_s = min(LONGEST_WAIT_S, POINTS_AT_ONCE * self.interval_s)
        try:
            self.write()  # opens the file, so that it can be read before there are new points
            while not self._stop.is_set():
                self._wake.wait(wait_s)
                self._wake.clear()
                self.write()
                with self._lock:
                    done, self._done = self._done, threading.Event()
                done.set()
            self._next_try = -math.inf
            self.write()
        except Exception:
            self._problem = sentence(
                "history failed", "the history is no longer written: an internal fault, see the log"
            )
            log.critical("the history has failed; monitoring goes on", exc_info=True)

    def _open_store(self) -> HistoryStore:
        if self.store is None:
            self.store = self._open()
            self._messages += self.store.messages
            for message in self.store.messages:
                log.warning("history", message=message)
        return self.store

    def _report(self, error: StoreError) -> None:
        self._next_try = self._clock() + RETRY_S
        if self._problem is None:
            log.error("the history cannot be written; retrying", reason=str(error))
        self._problem = sentence(
            "history not written",
            "the history cannot be written yet, is tried again: {why}",
            why=error.args[0],
        )
        if error.is_damage and self.store is not None:
            damaged, self.store = self.store, None  # the next opening quarantines it
            damaged.close()

    def _end_problem(self) -> None:
        if self._problem is not None:
            log.info("the history is written again")
        self._problem = None

    def _drop_oldest(self) -> None:
        while len(self._waiting) > self._most_waiting:
            self._waiting.popleft()
            self._dropped[FULL] += 1


def _is_known(p: ParameterStatus) -> bool:
    if p.status in _LEARNING or p.not_tested is NotTested.CONDITIONS:
        return False
    return math.isfinite(p.estimate) and math.isfinite(p.standard_deviation)


def _point(axis_id: str, t: int, p: ParameterStatus) -> HistoryPoint:
    observability, deviation = OBSERVABILITY[p.observation], p.estimate - p.nominal
    values = (p.estimate, deviation, p.standard_deviation, p.g_up, p.g_down, p.h, observability)
    return HistoryPoint(HistorySeries(axis_id, p.name, p.unit), t, values)
