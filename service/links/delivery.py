"""Delivery of a link: the transitions of alarms, in order, each at least once, tried again until it is too old.

Time and chance are arguments, so that tests need not wait.
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
from service.config.schema_links import AlarmLimits
from service.pipeline.snapshot import LinkSnapshot
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import NumberedTransition, RecordedTransition
from service.store.database import StoreError
from service.store.journal import Journal
from service.store.outbox import Outbox
from service.texts.instants import now_us

FIRST_RETRY_S, LAST_RETRY_S = 1.0, 300.0
LONGEST_REQUESTED_S = 3600.0
"""A receiver may ask for that much time, not for more."""
LOOK_S = 0.25
"""Time after which a link looks for new transitions [s]"""
PAGE = 500
"""Transitions that are read at once."""

log = structlog.get_logger(__name__)


class UnavailableError(Exception):
    """The receiver cannot be reached, or cannot take anything now: it is tried again.

    ``retry_after_s``: the time for which it asks; None: it does not.
    """

    def __init__(self, reason: str, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(reason)


class RefusedError(Exception):
    """The receiver does not want this, now or later."""


class NotYetError(Exception):
    """It is not time to send this; in ``wait_s`` it may be."""

    def __init__(self, wait_s: float) -> None:
        self.wait_s = wait_s
        super().__init__(f"in {wait_s:g} s")


def answers(place: str, answer: str) -> Sentence:
    """What a receiver answers that does not take the message."""
    return sentence("link answers", "{place} answers {answer}", place=place, answer=answer)


class Message(NamedTuple):
    """A transition with the alarm as it is now."""

    id: str
    """Unique; the same whenever it is sent again"""
    transition: RecordedTransition
    alarm: RecordedAlarm
    recording: str | None = None
    """Name of the file with the raw frames around the alarm; None: there is none (yet)"""


class Receiver(Protocol):
    """Where a link delivers to."""

    most: int
    """Number of messages that it takes at once"""

    async def send(self, messages: Sequence[Message]) -> None:
        """Deliver all of them.

        Raises:
            UnavailableError: not possible now.
            RefusedError: never possible.
            NotYetError: not wanted yet.
        """


class Backoff:
    """Time between tries: doubled with each failure up to five minutes; by chance up to a half less."""

    def __init__(self, chance: Callable[[], float] = random.random) -> None:
        self._chance, self._failures = chance, 0

    def failed(self, requested_s: float | None = None) -> float:
        """Time to wait after one more failure, not less than the receiver asks for [s]."""
        longest_s = min(LAST_RETRY_S, FIRST_RETRY_S * 2.0 ** min(self._failures, 30))
        self._failures += 1
        wait_s = longest_s * (0.5 + 0.5 * self._chance())
        return max(wait_s, min(requested_s or 0.0, LONGEST_REQUESTED_S))

    def succeeded(self) -> None:
        """The next failure is the first one."""
        self._failures = 0


class LinkName(NamedTuple):
    """Name and kind of a link."""

    name: str
    kind: str


class _Waiting(NamedTuple):
    """A transition that waits, until it is too old by the clock that only grows [s]."""

    numbered: NumberedTransition
    until_s: float


class Delivery:
    """Transitions of the journal to one receiver.

    Args:
        link: which one it is.
        limits: which alarms it delivers, and for how long.
        receiver: delivers.
        journal: with what is promised.
        outbox: how far the link is.
        done: number of the last transition that it is done with.
        clock: time that only grows [s].
        now_us: wall clock, for the age of a transition when it is read.
        chance: from 0 to 1, for the time between tries.
        recording_of: name of the recording of a time; None: there is none (yet).
    """

    def __init__(
        self,
        link: LinkName,
        limits: AlarmLimits,
        receiver: Receiver,
        journal: Journal,
        outbox: Outbox,
        done: int,
        clock: Callable[[], float] = monotonic,
        now_us: Callable[[], int] = now_us,
        chance: Callable[[], float] = random.random,
        recording_of: Callable[[int], str | None] = lambda _t_us: None,
    ) -> None:
        self._recording_of = recording_of
        self._link, self._limits, self._receiver = link, limits, receiver
        self._journal, self._outbox = journal, outbox
        self._clock, self._now_us, self._backoff = clock, now_us, Backoff(chance)
        self._waiting = deque[_Waiting]()
        self._read_to = self._saved = done
        self._beyond, self._revision, self._next_try = 0, -1, -math.inf
        self._log = log.bind(link=link.name)
        self._is_saved = True
        self.snapshot = LinkSnapshot(link.name, link.kind, connected=True)
        """The newest state; others read it in one assignment"""

    def begin(self) -> None:
        """The link needs a connection, which it does not have yet."""
        self.snapshot = replace(
            self.snapshot, connected=False, problem=sentence("link begins", "not connected yet")
        )

    async def step(self) -> float:
        """Deliver what waits, at most once; the time until there is something to do [s]; infinite: nothing waits."""
        self.look()
        left_s = math.inf
        if self._waiting:
            left_s = self._next_try - self._clock()
            if left_s <= 0:
                left_s = await self._send()
                self._finish()
        return left_s

    def look(self) -> None:
        """Read what has been recorded since, and give up what is too old; deliver nothing."""
        with suppress(StoreError):  # of the journal, which the worker reports
            self._read()
        self._give_up_old()
        self._finish()

    def _finish(self) -> None:
        self._save()
        self.snapshot = replace(self.snapshot, pending=len(self._waiting) + self._beyond)

    def failed(self, problem: str, requested_s: float | None = None) -> float:
        """The link does not work; the time until the next try [s]."""
        if self.snapshot.connected:
            self._log.warning("a link is down", reason=problem)
        self.snapshot = replace(self.snapshot, connected=False, problem=problem)
        wait_s = self._backoff.failed(requested_s)
        self._next_try = self._clock() + wait_s
        return wait_s

    def works(self, problem: str = "") -> None:
        """The link works, but may have something to report."""
        if not self.snapshot.connected:
            self._log.info("a link is up")
        self.snapshot = replace(self.snapshot, connected=True, problem=problem)
        self._backoff.succeeded()
        self._next_try = -math.inf

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
        """Read what has been recorded since, unless so much waits already."""
        revision = self._journal.revision
        if revision == self._revision:
            return
        room = PAGE - len(self._waiting)
        page = self._journal.transitions_after(self._read_to, room) if room > 0 else []
        for numbered in page:
            if numbered.priority in self._limits.priorities:
                self._waiting.append(_Waiting(numbered, self._clock() + self._left_s(numbered)))
            self._read_to = numbered.number
        complete = len(page) < room
        self._beyond = 0 if complete else self._journal.last_transition() - self._read_to
        self._revision = revision if complete else -1

    def _left_s(self, numbered: NumberedTransition) -> float:
        """Time for which it may still wait [s]; a wall clock that is set later changes nothing of that."""
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
        """Remember how far the link is; a failure costs nothing but repetitions after a restart."""
        done = self._waiting[0].numbered.number - 1 if self._waiting else self._read_to
        if done == self._saved:
            return
        try:
            self._outbox.done(self._link.name, done)
            self._saved, self._is_saved = done, True
        except StoreError as error:
            if self._is_saved:
                self._log.error(
                    "what a link has delivered cannot be saved; it may come again", reason=str(error)
                )
            self._is_saved = False
