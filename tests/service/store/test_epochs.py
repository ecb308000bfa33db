"""Epochs in the file of the alarms: one transaction each, whatever ends the process."""

import os
import signal
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent, AlarmRules, AlarmState
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_transitions import Note
from service.store.database import StoreError
from service.store.epochs import Epoch, EpochPlan, EpochValue
from service.store.journal import Journal
from tests.service.store.connections import Watched, connections

AXIS = "cell.a3"
FIRST = EpochPlan(AXIS, "configuration", "{}", "as built", (EpochValue("fm", "N m s/rad", 0.06),))
NOTE = Note(2_000, "anna", "gearbox changed", "WO-7")
PLAN = EpochPlan(AXIS, "files", '{"a": 1}', "as built", (EpochValue("fm", "N m s/rad", 0.07, 0.06, 1e-3),), None, 60.0)
OPEN = Alarm("fm", "up", 10, 20, 30, None, 0.02, 0.001, 3)


def journal_with_alarms(folder: Path) -> Journal:
    """Three open alarms: one is acknowledged, one is not, one is latched and acknowledged."""
    journal = Journal(folder / "alarms.sqlite")
    journal.epochs.begin_with([FIRST], 5)
    rules = AlarmRules(latched=True)
    entries = [
        AlarmEntry(AXIS, "N m s/rad", 0.06, OPEN),
        AlarmEntry(AXIS, "1", 1.0, Alarm("kT", "up", 10, 21, 30, None, 0.2, 0.1, 1)),
        AlarmEntry(AXIS, "1", 1.0, Alarm("Ja", "up", 10, 22, 30, None, 0.2, 0.1, 1), rules),
        AlarmEntry("cell.a4", "1", 1.0, Alarm("kT", "up", 10, 23, 30, None, 0.2, 0.1, 1)),
    ]
    numbers = journal.record(entries)
    for number in (numbers[0], numbers[2]):
        journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(40, "anna"))
    return journal


def alarm_states(journal: Journal) -> dict[str, AlarmState]:
    return {f"{a.axis} {a.parameter}": a.state for a in journal.query()[0]}


BEFORE = {
    "cell.a3 fm": AlarmState.ACKNOWLEDGED,
    "cell.a3 kT": AlarmState.UNACKNOWLEDGED,
    "cell.a3 Ja": AlarmState.ACKNOWLEDGED,
    "cell.a4 kT": AlarmState.UNACKNOWLEDGED,
}
AFTER = {
    "cell.a3 fm": AlarmState.NORMAL,
    "cell.a3 kT": AlarmState.RETURNED,  # nobody has acknowledged it yet
    "cell.a3 Ja": AlarmState.LATCHED,
    "cell.a4 kT": AlarmState.UNACKNOWLEDGED,
}
RULES = {"Ja": AlarmRules(latched=True)}


def test_the_alarms_of_the_former_epoch_end_with_it(tmp_path: Path) -> None:
    journal = journal_with_alarms(tmp_path)
    assert alarm_states(journal) == BEFORE
    epoch = journal.epochs.take_over(PLAN, NOTE, RULES)
    assert (epoch.number, epoch.state, epoch.in_force_us, epoch.nominal) == (
        2,
        "verifying",
        2_000,
        PLAN.nominal,
    )
    assert alarm_states(journal) == AFTER
    (last,) = journal.transitions(1)[-1:]
    assert (last.event, last.who, last.comment) == (
        AlarmEvent.CLEAR,
        "anna",
        "epoch 2 of cell.a3 has begun: gearbox changed",
    )
    assert journal.ended_alarms(AXIS, 20) == []  # none of them is reopened by the new monitor
    journal.close()


def test_learned_verified_rolled_back(tmp_path: Path) -> None:
    journal = journal_with_alarms(tmp_path)
    epochs = journal.epochs
    window = PLAN._replace(source="window", learn_s=3600.0)
    assert epochs.learn(window, NOTE).state == "learning"
    assert [e.axis for e in epochs.learning()] == [AXIS]
    assert epochs.take_over(window, NOTE).number == 2
    epochs.verified(AXIS, 1, NOTE)  # that one is not in force
    epochs.verified(AXIS, 2, NOTE)
    back = epochs.take_over(PLAN._replace(source="restored", restored_from=1, verify_s=0.0), NOTE)
    assert (back.number, back.restored_from, back.state) == (3, 1, "current")
    assert [e.state for e in epochs.of_axis(AXIS)] == ["current", "rolled_back", "closed"]
    events = epochs.events(AXIS)
    assert [e.event for e in events[1]] == ["taken over", "replaced"]
    assert [e.event for e in events[2]] == ["begun", "taken over", "verified", "rolled back"]
    assert epochs.cancel(AXIS, NOTE, "cancelled", "") is None
    journal.close()


def test_the_last_deliberate_act_counts(tmp_path: Path) -> None:
    journal = journal_with_alarms(tmp_path)
    epochs = journal.epochs
    epochs.take_over(PLAN, NOTE)
    assert epochs.begin_with([FIRST], 3_000)[AXIS].number == 2
    epochs.learn(PLAN._replace(source="window"), NOTE)
    edited = FIRST._replace(fingerprint="edited")
    assert epochs.begin_with([edited], 3_000)[AXIS].source == "configuration"
    assert [e.state for e in epochs.of_axis(AXIS)] == ["current", "cancelled", "closed", "closed"]
    assert epochs.begin_with([edited], 4_000)[AXIS].number == 4
    journal.close()


def seen(journal: Journal) -> tuple[list[Epoch], Mapping[str, AlarmState]]:
    return journal.epochs.of_axis(AXIS), alarm_states(journal)


def killed_at(statement: int) -> Callable[[str], None]:
    """Ends this process at that statement."""
    left = iter(range(statement - 1, -1, -1))

    def count(_text: str) -> None:
        if next(left) == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    return count


def test_killed_at_any_statement_it_is_the_old_epoch_or_the_new_one(tmp_path: Path) -> None:
    """SIGKILL in a process of its own, at each statement of the transaction in turn."""
    journal_with_alarms(tmp_path).close()
    outcomes = []
    for statement in range(1, 60):
        child = os.fork()
        if not child:
            with connections() as opened:
                journal = Journal(tmp_path / "alarms.sqlite")
            opened[0].set_trace_callback(killed_at(statement))
            journal.epochs.take_over(PLAN, NOTE, RULES)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        journal = Journal(tmp_path / "alarms.sqlite")
        found, states = seen(journal)
        journal.close()
        if os.WIFEXITED(status):
            break
        if len(found) == 1:
            assert ([e.state for e in found], states) == (["current"], BEFORE)
        else:  # killed after the commit
            break
        outcomes.append(statement)
    assert len(outcomes) > 10
    assert ([e.state for e in found], states) == (["verifying", "closed"], AFTER)


def test_refused_at_any_statement_it_leaves_all_as_it_was(tmp_path: Path) -> None:
    with connections(Watched) as opened:
        journal = journal_with_alarms(tmp_path)
    writer, before, statements = opened[0], seen(journal), 0
    while seen(journal) == before:
        left = iter(range(statements, -1, -1))

        def refuse(left: Iterator[int] = left) -> None:
            if next(left, None) == 0:
                raise sqlite3.OperationalError("in the middle")

        writer.before = refuse
        with suppress(StoreError):
            journal.epochs.take_over(PLAN, NOTE, RULES)
        statements += 1
    writer.before = lambda: None
    assert statements > 10
    assert [e.state for e in seen(journal)[0]] == ["verifying", "closed"]
    assert seen(journal)[1] == AFTER
    journal.close()
