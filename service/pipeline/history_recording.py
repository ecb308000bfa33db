"""From the status of the axes to the history: points wait in memory, and a thread of its own writes them.

The worker only appends; a slow, full, locked or damaged disk costs it nothing.
"""

import math
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from time import monotonic, time
from typing import NamedTuple

import structlog

from monitor_core.monitoring import AxisStatus, NotTested, Observation, ParameterStatus, Status
from monitor_core.wording import sentence
from service.store.database import StoreError
from service.store.history_store import HistoryStore, Point, Series

POINTS_AT_ONCE = 6
"""Of each parameter in a transaction: each writes a page of the file for each parameter and resolution."""
LOOKS = 20
"""For a point in each interval, as long as there are no estimates."""
LONGEST_WAIT_S = 600.0
"""Until points are written."""
RETRY_S = 10.0
FRESH_S = 0.5
"""For which a reader waits for what is written at its wish"""
MOST_WAITING = 200_000
"""Points that wait while the disk does not take them, about 60 MB: of 18 parameters, one each 10 s, 30 hours."""
OBSERVABILITY: Mapping[Observation, float] = {
    Observation.OBSERVED: 1.0,
    Observation.WEAK: 0.5,
    Observation.UNSEEN: 0.0,
}
_LEARNING = (Status.WAITING, Status.SETTLING, Status.SEEDING, Status.INVALID)

FULL = "memory full"
"""Why points are dropped: too many wait"""

log = structlog.get_logger(__name__)


class HistoryState(NamedTuple):
    """How the history is being written; ``problem``: why points wait, for the operator; None: they do not."""

    waiting: int = 0
    dropped: Mapping[str, int] = {FULL: 0}
    problem: str | None = None
    messages: tuple[str, ...] = ()


NO_HISTORY = HistoryState()


class HistoryRecording:
    """Takes a point of each parameter in each interval, and writes them.

    Args:
        open_store: opens the file; called by the thread, again after it has failed.
        interval_s: time between two points of a parameter [s].
        clock: for the time between two writes [s].
        now_s: the wall clock, for what is too old [s since 1970].
        most_waiting: points that may wait.
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
        """Time of the sample at which a point was looked for last, by axis"""
        self._waiting = deque[Point]()
        self._lock = threading.Lock()
        self._dropped = Counter({FULL: 0})
        self._next_try = -math.inf
        self._begun = -math.inf
        self._stop, self._wake, self._done = threading.Event(), threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="history", daemon=True)
        self.store: HistoryStore | None = None
        """The file, once it is open"""
        self._problem: str | None = None
        self._messages: tuple[str, ...] = ()

    # --- the worker's side --------------------------------------------------------------------------------

    def is_due(self, axis_id: str, time_us: int | None) -> bool:
        """Whether ``take`` may find a point of an axis, whose last sample is of that time.

        While there are no estimates it is looked for a few times in each interval.
        """
        if time_us is None or self._slots.get(axis_id) == self._slot(time_us):
            return False
        looked_us = self._looked_us.get(axis_id)
        return looked_us is None or abs(time_us - looked_us) >= self.interval_s * 1e6 / LOOKS

    def take(self, axis_id: str, status: AxisStatus, paused: bool) -> None:
        """Keep the status of an axis if a point is due: the first in each interval of the samples' time that has any.

        Parameters without an estimate of now have none: no sample, learning, invalid, or the axis is ``paused``.
        """
        if status.time_us is None:
            return
        self._looked_us[axis_id] = status.time_us
        slot = self._slot(status.time_us)
        if self._slots.get(axis_id) == slot:
            return
        t = math.floor(slot * self.interval_s)
        found = [] if paused else [_point(axis_id, t, p) for p in status.parameters if _is_known(p)]
        if not found:  # the estimates may begin within this interval
            return
        self._slots[axis_id] = slot
        with self._lock:
            self._waiting.extend(found)
            self._drop_oldest()

    def _slot(self, time_us: int) -> int:
        return math.floor(time_us / (self.interval_s * 1e6))

    def state(self) -> HistoryState:
        """How it is being written now."""
        with self._lock:
            return HistoryState(len(self._waiting), dict(self._dropped), self._problem, self._messages)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def stop(self) -> None:
        """Write what waits, if the disk takes it now, and close the file."""
        self._stop.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()
        if self.store is not None:
            self.store.close()

    # --- a reader's side ----------------------------------------------------------------------------------

    def freshen(self) -> None:
        """Have what waits written now, but not more often than there are points; a slow disk is not waited for."""
        with self._lock:
            young = self._clock() - self._begun < self.interval_s
            if young or not self._waiting or not self._thread.is_alive():
                return
            done = self._done
        self._wake.set()
        done.wait(FRESH_S)

    # --- the writer's side --------------------------------------------------------------------------------

    def write(self) -> None:
        """Write what waits, unless the last try has failed a moment ago."""
        if self._clock() < self._next_try:
            return
        with self._lock:
            self._begun = self._clock()
            found = list(self._waiting)
            self._waiting.clear()
        try:
            store = self._opened()
            store.add(found)
        except StoreError as error:
            with self._lock:
                self._waiting.extendleft(reversed(found))
                self._drop_oldest()
            self._failed(error)
            return
        self._end_problem()
        try:
            store.prune(self._now_s())
        except StoreError as error:
            self._failed(error)

    def _run(self) -> None:
        wait_s = min(LONGEST_WAIT_S, POINTS_AT_ONCE * self.interval_s)
        try:
            self.write()  # opens the file: what it holds can be read before there are points
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

    def _opened(self) -> HistoryStore:
        if self.store is None:
            self.store = self._open()
            self._messages += self.store.messages
            for message in self.store.messages:
                log.warning("history", message=message)
        return self.store

    def _failed(self, error: StoreError) -> None:
        self._next_try = self._clock() + RETRY_S
        if self._problem is None:
            log.error("the history cannot be written; it is tried again", reason=str(error))
        self._problem = sentence(
            "history not written", "the history cannot be written yet, is tried again: {why}", why=error
        )
        if error.is_damage and self.store is not None:
            damaged, self.store = self.store, None  # opened again, it is quarantined
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


def _point(axis_id: str, t: int, p: ParameterStatus) -> Point:
    observability, deviation = OBSERVABILITY[p.observation], p.estimate - p.nominal
    values = (p.estimate, deviation, p.standard_deviation, p.g_up, p.g_down, p.h, observability)
    return Point(Series(axis_id, p.name, p.unit), t, values)
