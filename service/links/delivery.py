"""Delivery of alarm transitions to one link: in order, each at least once, with retries until it is too old.

Clock and random numbers are arguments, so that tests need not wait.
"""

import math
import random
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice, takewhile
from time import monotonic
from typing import NamedTuple, Protocol

import structlog

from monitor_core.wording import Sentence, sentence
from service.config.schema import AlarmLimits
from service.pipeline.snapshot import LinkSnapshot
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import NumberedTransition, RecordedTransition
from service.store.database import StoreError
from service.store.journal import Journal
from service.store.outbox import Outbox
from service.texts.instants import now_us

FIRST_RETRY_S, LAST_RETRY_S = 1.0, 300.0
LONGEST_REQUESTED_S = 3600.0
"""Longest time for which a receiver may postpone the next try."""
LOOK_S = 0.25
"""Time between two checks for new transitions [s]"""
PAGE = 500
"""Most transitions in one read, and most that wait in memory."""

log = structlog.get_logger(__name__)


class UnavailableError(Exception):
    """The receiver cannot be reached, or accepts nothing now; delivery is retried.

    ``retry_after_s``: waiting time that the receiver requests; None: none.
    """

    def __init__(self, reason: str, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(reason)


class RefusedError(Exception):
    """The receiver refuses this message permanently."""


class NotYetError(Exception):
    """It is too early to send this; try again after ``wait_s``."""

    def __init__(self, wait_s: float) -> None:
        self.wait_s = wait_s
        super().__init__(f"in {wait_s:g} s")


def answers(place: str, answer: str) -> Sentence:
    """The reason that a receiver has refused a message with this answer."""
    return sentence("link answers", "{place} answers {answer}", place=place, answer=answer)


class Message(NamedTuple):
    """A transition and the present state of its alarm."""

    id: str
    """Unique; the same in repeated deliveries"""
    transition: RecordedTransition
    alarm: RecordedAlarm
    recording: str | None = None
    """Name of the file with the raw frames around the alarm; None: there is none (yet)"""


class MessageReceiver(Protocol):
    """Interface of a receiver of messages."""

    most: int
    """Most messages in one call"""

    async def send(self, messages: Sequence[Message]) -> None:
        """Deliver all messages.

        Raises:
            UnavailableError: delivery is not possible now.
            RefusedError: the receiver refuses the messages.
            NotYetError: the receiver wants to wait.
        """


class _WaitingTransition(NamedTuple):
    """A waiting transition, and the monotonic time at which it becomes too old [s]."""

    numbered: NumberedTransition
    until_s: float


class MessageSource(NamedTuple):
    """What all links deliver from."""

    journal: Journal
    """Has the transitions and the alarms"""
    outbox: Outbox
    """Stores the number of the last finished transition of each link"""
    recording_of: Callable[[int], str | None]
    """Returns the name of the recording of a time; None: there is none (yet)"""


class DeliveryTimes(NamedTuple):
    """The clocks of a delivery, and the chance in the time between its tries."""

    clock: Callable[[], float] = monotonic
    """Monotonic clock [s]"""
    now_us: Callable[[], int] = now_us
    """Wall clock, for the age of a transition when it is read"""
    chance: Callable[[], float] = random.random
    """Random number from 0 to 1"""


_REAL_TIMES = DeliveryTimes()


class Delivery:
    """Delivers transitions of the journal to one receiver.

    Args:
        link: the state of the link at the start.
        limits: which alarms to deliver, and for how long to try.
        receiver: delivers the messages.
        source: where they are from.
        done: number of the last finished transition at the start.
        times: clocks.
    """

    def __init__(
        self,
        link: LinkSnapshot,
        limits: AlarmLimits,
        receiver: MessageReceiver,
        source: MessageSource,
        done: int,
        times: DeliveryTimes = _REAL_TIMES,
    ) -> None:
        self._limits, self._receiver = limits, receiver
        self._journal, self._outbox, self._recording_of = source
        self._clock, self._now_us, self._chance = times
        self._waiting = deque[_WaitingTransition]()
        self._read_to = self._saved = done
        self._beyond, self._revision, self._failures, self._next_try = 0, -1, 0, -math.inf
        self._log = log.bind(link=link.name)
        self._is_saved = True
        self.snapshot = link
        """The present state; replaced in one assignment, so that other threads can read it"""

    def begin(self) -> None:
        """Mark the link as not connected yet, if it needs a lasting connection."""
        self.snapshot = replace(self.snapshot, connected=False, problem=sentence("link begins", "not connected yet"))

    async def step(self) -> float:
        """Read new transitions, and deliver at most once; returns the time until the next step [s], inf: none waits."""
        self.read_new()
        left_s = math.inf
        if self._waiting:
            left_s = self._next_try - self._clock()
            if left_s <= 0:
                left_s = await self._send()
                self._finish()
        return left_s

    def read_new(self) -> None:
        """Read new transitions and give up those that are too old, without delivering."""
        with suppress(StoreError):  # the worker reports errors of the journal
            self._read()
        self._give_up_old()
        self._finish()

    def _finish(self) -> None:
        self._save()
        self.snapshot = replace(self.snapshot, pending=len(self._waiting) + self._beyond)

    def failed(self, problem: str, requested_s: float | None = None) -> float:
        """Mark the link as not working; returns the time until the next try [s].

        It doubles with each failure up to five minutes; a random part of up to a half is subtracted.  It is at least
        ``requested_s``, the time that the receiver requests.
        """
        if self.snapshot.connected:
            self._log.warning("a link is down", reason=problem)
        self.snapshot = replace(self.snapshot, connected=False, problem=problem)
        longest_s = min(LAST_RETRY_S, FIRST_RETRY_S * 2.0 ** min(self._failures, 30))
        self._failures += 1
        wait_s = max(longest_s * (0.5 + 0.5 * self._chance()), min(requested_s or 0.0, LONGEST_REQUESTED_S))
        self._next_try = self._clock() + wait_s
        return wait_s

    def works(self, problem: str = "") -> None:
        """Mark the link as working; ``problem``: a remaining problem to show."""
        if not self.snapshot.connected:
            self._log.info("a link is up")
        self.snapshot = replace(self.snapshot, connected=True, problem=problem)
        self._failures, self._next_try = 0, -math.inf

    async def _send(self) -> float:
        numbered = [w.numbered for w in islice(self._waiting, self._receiver.most)]
        try:
            messages = [self._message(n) for n in numbered]
        except StoreError:
            return FIRST_RETRY_S
        try:
            await self._receiver.send(messages)
        except NotYetError as error:
            self._next_try = self._clock() + error.wait_s
            return error.wait_s
        except UnavailableError as error:
            return self.failed(error.args[0], error.retry_after_s)
        except RefusedError as error:
            self._give_up(len(numbered), "refused", str(error))
            self.works(error.args[0])
            return 0.0
        self._drop(len(numbered))
        self.snapshot = replace(self.snapshot, delivered=self.snapshot.delivered + len(numbered))
        self.works()
        return 0.0

    def _message(self, n: NumberedTransition) -> Message:
        alarm = self._journal.get(n.alarm_id)
        assert alarm is not None  # no alarm is ever removed from the journal
        recording = self._recording_of(alarm.since_us)
        return Message(f"{self._journal.identity}-{n.number}", n.transition, alarm, recording)

    def _read(self) -> None:
        """Read new transitions, unless ``PAGE`` transitions already wait."""
        revision = self._journal.revision
        if revision == self._revision:
            return
        free = PAGE - len(self._waiting)
        page = self._journal.transitions_after(self._read_to, free) if free > 0 else []
        for numbered in page:
            if numbered.priority in self._limits.priorities:
                self._waiting.append(_WaitingTransition(numbered, self._clock() + self._left_s(numbered)))
            self._read_to = numbered.number
        complete = len(page) < free
        self._beyond = 0 if complete else self._journal.last_transition() - self._read_to
        self._revision = revision if complete else -1

    def _left_s(self, numbered: NumberedTransition) -> float:
        """Time for which a transition may still wait [s]; later steps of the wall clock have no effect on it."""
        age_s = max(0.0, (self._now_us() - numbered.transition.at_us) / 1e6)
        return self._limits.max_age_s - age_s

    def _give_up_old(self) -> None:
        now = self._clock()
        old = len([*takewhile(lambda w: w.until_s < now, self._waiting)])
        if old:
            self._give_up(old, "age", f"older than {self._limits.max_age_s:g} s")

    def _give_up(self, count: int, reason: str, why: str) -> None:
        first = self._waiting[0].numbered
        at = {"alarm": first.alarm_id, "transition": first.transition.event, "number": first.number}
        self._log.error("a link gives up", reason=reason, why=why, transitions=count, first=at)
        given_up = dict(self.snapshot.given_up)
        given_up[reason] += count
        self.snapshot = replace(self.snapshot, given_up=given_up)
        self._drop(count)

    def _drop(self, count: int) -> None:
        for _ in range(count):
            self._waiting.popleft()

    def _save(self) -> None:
        """Store the number of the last finished transition; a failure only causes repetitions after a restart."""
        done = self._waiting[0].numbered.number - 1 if self._waiting else self._read_to
        if done == self._saved:
            return
        try:
            self._outbox.done(self.snapshot.name, done)
            self._saved, self._is_saved = done, True
        except StoreError as error:
            if self._is_saved:
                self._log.error("the progress of a link cannot be saved; messages may be repeated", reason=str(error))
            self._is_saved = False
