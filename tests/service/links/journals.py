"""A journal with alarms, and a delivery of them whose time stands still until it is moved."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from monitor_core.detection import Alarm, Cause, FormerName
from monitor_core.monitoring import PRIORITIES, AlarmEvent, AlarmRules, Priority
from service.config.schema import AlarmLimits, LinksConfig
from service.links.delivery import Delivery, DeliveryTimes, Message, MessageSource
from service.links.running import Links
from service.pipeline.snapshot import LinkSnapshot, Snapshot
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from service.store.outbox import Outbox
from service.texts.instants import now_us
from tests.service.web.conftest import whole_snapshot

AXIS, SECOND = "demo.axis1", 1_000_000
NOON_US = 1_772_366_400_000_000
"""2026-03-01T12:00:00Z"""
RAISED = Alarm("kT", "up", NOON_US - 2 * SECOND, NOON_US, NOON_US, None, None, None, 1)
NAMED = replace(
    RAISED, parameter="fm", stage="named", kind="step", size=0.018, size_sd=0.002, causes=(Cause("fm", 0.97),),
    updated_us=NOON_US + 5 * SECOND, past=(FormerName(NOON_US + 4 * SECOND, "changed", "kT", "up"),),
)  # fmt: skip


def record(journal: Journal, alarm: Alarm = RAISED, axis: str = AXIS, rules: AlarmRules | None = None) -> int:
    """Record an alarm; its id."""
    (number,) = journal.record([AlarmEntry(axis, "N m s/rad", 0.06, alarm, rules or AlarmRules())])
    return number


def just_raised() -> Alarm:
    """An alarm of now, by the clock of this machine."""
    return replace(RAISED, onset_us=now_us(), raised_us=now_us(), updated_us=now_us())


def alarms(journal: Journal, count: int) -> None:
    """Raise alarms of as many axes."""
    for k in range(count):
        record(journal, RAISED, f"demo.axis{k}")


def comment(journal: Journal, alarm_id: int, text: str = "x") -> None:
    journal.act(alarm_id, AlarmEvent.COMMENT, Note(NOON_US, "anna", text))


@dataclass
class Inbox:
    """A receiver that keeps what it gets, or fails as it is told to."""

    most: int = 1
    failures: list[Exception] = field(default_factory=list)
    got: list[Message] = field(default_factory=list)

    async def send(self, messages: Sequence[Message]) -> None:
        if self.failures:
            raise self.failures.pop(0)
        self.got += messages

    @property
    def events(self) -> list[str]:
        return [f"{m.alarm.axis.removeprefix('demo.')} {m.transition.event}" for m in self.got]


@contextmanager
def linked(
    config: LinksConfig, folder: Path, snapshot: Callable[[], Snapshot] = whole_snapshot
) -> Iterator[tuple[Links, Journal]]:
    """Running links, and the journal that they deliver from."""
    with closing(Journal(folder / "alarms.sqlite")) as journal:
        links = Links(config, folder, journal, snapshot)
        links.start()
        try:
            yield links, journal
        finally:
            links.stop()


class Post:
    """A journal, its outbox and one link."""

    inbox: Any
    """As given; after ``close`` it may be another receiver"""

    def __init__(self, folder: Path, inbox: Inbox, priorities: Sequence[Priority] = PRIORITIES) -> None:
        self.folder, self.inbox, self.priorities = folder, inbox, priorities
        self.clock_s, self.now_us = 0.0, NOON_US
        self.recording: str | None = None
        self.open()

    def open(self) -> None:
        """As at the start of the daemon."""
        self.journal = Journal(self.folder / "alarms.sqlite")
        self.outbox = Outbox(self.folder / "links.sqlite", self.journal)
        self.delivery = Delivery(
            LinkSnapshot("orders", "webhook", connected=True),
            AlarmLimits.model_validate({"priorities": self.priorities, "max_age_s": 3600.0}),
            self.inbox,
            MessageSource(self.journal, self.outbox, lambda t_us: self.recording if t_us == RAISED.raised_us else None),
            self.outbox.begin(["orders"])["orders"],
            DeliveryTimes(lambda: self.clock_s, lambda: self.now_us, lambda: 1.0),
        )

    def close(self) -> None:
        """As at the end of the daemon."""
        self.outbox.close()
        self.journal.close()

    def step(self) -> float:
        """The time until the next step [s]."""
        return asyncio.run(self.delivery.step())

    def settle(self) -> float:
        """Step until nothing can be done now; the time until then [s]."""
        while (left_s := self.step()) == 0:
            pass
        return left_s

    def wait(self, seconds: float) -> None:
        self.clock_s += seconds
        self.now_us += round(seconds * SECOND)
