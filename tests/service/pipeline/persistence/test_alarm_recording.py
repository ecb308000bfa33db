"""Alarms are shown though the disk is full, and are recorded later."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent, AlarmRules, AlarmTransitionError
from service.config import load
from service.config.schema import AlarmsConfig
from service.pipeline.axes.axis_alarms import AxisAlarm, JournalQuantity, alarm_rules
from service.pipeline.persistence.alarm_recording import RETRY_S, AlarmRecorder
from service.store import database
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from tests.service.config.config_texts import CONFIG

AXIS = "cell.axis1"
QUANTITIES = {(AXIS, "fm"): JournalQuantity("N m s/rad", 0.06), (AXIS, "kT"): JournalQuantity("1", 1.0)}


def episode(parameter: str = "fm", crossings: int = 1, ended_us: int | None = None, raised_us: int = 20) -> Alarm:
    return Alarm(parameter, "up", 10, raised_us, raised_us + crossings, ended_us, 0.02, 0.001, crossings)


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "alarms.sqlite"


@pytest.fixture
def journal(path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Journal]:
    monkeypatch.setattr(database, "BUSY_TIMEOUT_S", 0.02)
    journal = Journal(path)
    yield journal
    journal.close()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Another program holds the file."""
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    yield
    other.close()


def test_what_the_disk_refuses_is_shown_at_once_and_written_later_in_order(path: Path, journal: Journal) -> None:
    clock = Clock()
    alarms = AlarmRecorder(journal, QUANTITIES, clock, {(AXIS, "fm"): AlarmRules("high")})
    with locked(path):
        alarms.record([AxisAlarm(AXIS, episode())])
        assert alarms.open(AXIS) == (episode(),)
        (shown,) = alarms.snapshot(0).unrecorded
        assert (shown.id, shown.recorded, shown.state, shown.priority) == (1, False, "unacknowledged", "high")
        assert (shown.parameter, shown.raised_us, shown.unit, shown.nominal) == ("fm", 20, "N m s/rad", 0.06)
        assert "alarm of cell.axis1 fm up: cannot be recorded yet, is tried again" in str(alarms.problem)
        assert "locked" in str(alarms.problem)
        # It ends and another one begins before the disk is there again.
        alarms.record([AxisAlarm(AXIS, episode(ended_us=50))])
        assert alarms.open(AXIS) == ()
        alarms.record([AxisAlarm(AXIS, episode(raised_us=70)), AxisAlarm(AXIS, episode("kT", raised_us=80))])
        waiting = [(a.id, a.raised_us, a.state) for a in alarms.snapshot(0).unrecorded]
        assert waiting == [(1, 20, "returned"), (0, 70, "unacknowledged"), (0, 80, "unacknowledged")]
        assert alarms.snapshot(0).waiting == 3
    alarms.record([])
    assert journal.query()[1] == 0, "no second try so soon"
    clock.now += RETRY_S
    alarms.record([])
    assert alarms.problem is None
    assert alarms.open(AXIS) == (episode(raised_us=70), episode("kT", raised_us=80))
    found = [(a.id, a.parameter, a.raised_us, a.ended_us) for a in journal.query()[0][::-1]]
    assert found == [(1, "fm", 20, 50), (2, "fm", 70, None), (3, "kT", 80, None)]
    after = alarms.snapshot(0)
    assert ([a.id for a in after.standing], after.unrecorded, after.waiting) == ([2, 3], (), 0)
    assert {(c.state, c.priority): c.alarms for c in after.states} == {
        ("returned", "high"): 1,
        ("unacknowledged", "high"): 1,
        ("unacknowledged", "medium"): 1,
    }


def test_what_a_person_acknowledges_before_the_disk_takes_it_is_written_with_it(path: Path, journal: Journal) -> None:
    clock, note = Clock(), Note(60, "anna", "heard it", "WO-1")
    alarms = AlarmRecorder(journal, QUANTITIES, clock, {(AXIS, "kT"): AlarmRules(latched=True)})
    alarms.record([AxisAlarm(AXIS, episode("kT", raised_us=10, ended_us=15))])
    with locked(path):
        ended, standing = episode("kT", raised_us=20, ended_us=50), episode(raised_us=30)
        alarms.record([AxisAlarm(AXIS, ended), AxisAlarm(AXIS, standing), AxisAlarm(AXIS, episode("kT", raised_us=40))])
        assert [(a.id, a.state) for a in alarms.snapshot(55).unrecorded] == [
            (2, "latched"), (3, "unacknowledged"), (4, "unacknowledged"),
        ]  # fmt: skip
        for number, state in ((2, "normal"), (3, "acknowledged")):
            done = alarms.acknowledge(number, note)
            assert done is not None
            assert (done.id, done.recorded, done.state, done.work_order) == (number, False, state, "WO-1")
            with pytest.raises(AlarmTransitionError):
                alarms.acknowledge(number, note)
        assert alarms.acknowledge(1, note) is None
        assert [a.state for a in alarms.snapshot(61).unrecorded] == [
            "normal",
            "acknowledged",
            "unacknowledged",
        ]
        shown = alarms.snapshot(61).unrecorded[:2]
    clock.now += RETRY_S
    # It ends and comes back; a new one is behind those that were promised.
    alarms.record([AxisAlarm(AXIS, replace(standing, ended_us=70)), AxisAlarm(AXIS, episode(raised_us=80))])
    found = {a.id: a for a in journal.query()[0]}
    assert [found[n].parameter for n in (1, 2, 3, 4, 5)] == ["kT", "kT", "fm", "kT", "fm"]
    assert found[2] == replace(shown[0], recorded=True)
    assert [(t.at_us, t.event, t.who) for t in journal.transitions(2)] == [
        (20, "raise", "axiswatch"), (50, "latch", "axiswatch"), (60, "acknowledge", "anna"),
    ]  # fmt: skip
    assert [(t.at_us, t.event, t.comment) for t in journal.transitions(3)] == [
        (30, "raise", ""), (60, "acknowledge", "heard it"), (70, "clear", ""),
    ]  # fmt: skip
    assert (found[3].state, found[4].state) == ("normal", "unacknowledged")
    assert alarms.snapshot(81).unrecorded == ()


def test_at_the_end_what_waits_is_written_at_once_or_logged_as_lost(path: Path, journal: Journal) -> None:
    """The disk may have been made free a moment before the daemon is restarted."""
    alarms = AlarmRecorder(journal, QUANTITIES, Clock())
    with locked(path):
        alarms.record([AxisAlarm(AXIS, episode())])
        alarms.acknowledge(1, Note(60, "anna", "heard it"))
        with capture_logs() as logs:
            alarms.finish()
    (entry,) = [entry for entry in logs if entry["event"].startswith("alarm lost")]
    assert (entry["axis"], entry["parameter"], entry["acknowledged"]["who"]) == (AXIS, "fm", "anna")
    assert "locked" in entry["reason"]
    with capture_logs() as logs:
        alarms.finish()
    assert [entry["event"] for entry in logs] == ["alarm raised"]
    assert [a.state for a in journal.standing()] == ["acknowledged"]
    # The alarm is in the journal now: what is lost is only its newest size.
    with locked(path), capture_logs() as logs:
        alarms.record([AxisAlarm(AXIS, episode(crossings=2))])
        alarms.finish()
    assert logs[-1]["event"] == "the last change of a recorded alarm could not be recorded until the end"
    assert not any("alarm lost" in entry["event"] for entry in logs)


def test_what_persons_do_is_in_the_next_snapshot_and_shelves_end_by_the_given_clock(journal: Journal) -> None:
    clock = Clock()
    alarms = AlarmRecorder(journal, QUANTITIES, clock)
    alarms.record([AxisAlarm(AXIS, episode())])
    assert [a.state for a in alarms.snapshot(30).standing] == ["unacknowledged"]
    journal.act(1, AlarmEvent.SHELVE, Note(40, "anna"), 100)
    assert [a.state for a in alarms.snapshot(99).standing] == ["shelved"]
    assert [a.state for a in alarms.snapshot(100).standing] == ["unacknowledged"]
    assert [t.event for t in journal.transitions(1)] == ["raise", "shelve", "shelf ended"]


def test_an_off_delay_ends_by_the_given_clock(journal: Journal) -> None:
    rules = {(AXIS, "fm"): AlarmRules(off_delay_s=1e-5)}
    journal.apply_rules(rules, 0)
    alarms = AlarmRecorder(journal, QUANTITIES, Clock(), rules)
    alarms.record([AxisAlarm(AXIS, episode())])
    alarms.record([AxisAlarm(AXIS, episode(ended_us=50))])
    assert [(a.state, a.active) for a in alarms.snapshot(59).standing] == [("unacknowledged", True)]
    before = journal.revision
    alarms.snapshot(59)
    assert journal.revision == before  # nothing is written while there is nothing to do
    assert alarms.snapshot(60).standing == ()
    assert [(t.at_us, t.event) for t in journal.transitions(1)] == [(20, "raise"), (60, "clear")]


def test_an_axis_out_of_service_is_known_and_hides_alarms_that_the_disk_refuses(path: Path, journal: Journal) -> None:
    alarms = AlarmRecorder(journal, QUANTITIES, Clock())
    removed = Note(40, "anna", "new gearbox")
    assert alarms.removed(AXIS) is None
    journal.services.change(AXIS, AlarmEvent.REMOVE, removed)
    alarms.snapshot(50)
    assert alarms.removed(AXIS) == removed
    with locked(path):
        alarms.record([AxisAlarm(AXIS, episode())])
        assert [a.state for a in alarms.snapshot(51).unrecorded] == ["out-of-service"]


def test_rules_are_those_of_the_axis_and_its_parameter() -> None:
    config = load(CONFIG / "demo.toml", {})
    table = AlarmsConfig(
        priority="low", priorities={"fm": "high"}, latched=("kT",), suppressed=("fm",), off_delay_s=5.0
    )
    (first, second), name = config.axes[:2], ("demo.axis1", "fm")
    axes = [first._replace(config=first.config.model_copy(update={"alarms": table})), second]
    found = alarm_rules(axes, [name, ("demo.axis1", "kT"), ("demo.axis2", "fm")])
    assert found[name] == AlarmRules("high", suppressed=True, off_delay_s=5.0)
    assert found["demo.axis1", "kT"] == AlarmRules("low", latched=True, off_delay_s=5.0)
    assert found["demo.axis2", "fm"] == AlarmRules(off_delay_s=30 * second.config.memory_s)
    assert AlarmsConfig().rules("fm", memory_s=10).off_delay_s == 60


def test_the_end_of_an_alarm_is_shown_only_when_it_is_recorded(path: Path, journal: Journal) -> None:
    alarms = AlarmRecorder(journal, QUANTITIES)
    alarms.record([AxisAlarm(AXIS, episode())])
    with locked(path):
        alarms.record([AxisAlarm(AXIS, episode(ended_us=50))])
    assert alarms.open(AXIS) == (episode(),)
