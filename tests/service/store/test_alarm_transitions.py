"""What is done about an alarm is in the journal, in one transaction with the state that it makes."""

import sqlite3
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from monitor_core.detection import Alarm, Cause, Doubt
from monitor_core.detection.alarm import Direction
from monitor_core.monitoring import (
    AlarmEvent,
    AlarmLife,
    AlarmRules,
    AlarmState,
    AlarmTransitionError,
    ShelfEndError,
)
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_filter import AlarmFilter
from service.store.alarm_transitions import MIGRATION, Note
from service.store.database import StoreError
from service.store.journal import MIGRATIONS, Journal, UnknownAlarmError
from tests.core.alarm_lives import replayed

S, E = AlarmState, AlarmEvent
AXIS, SECOND = "demo.axis1", 1_000_000
RAISED = Alarm("fm", "up", 1 * SECOND, 2 * SECOND, 2 * SECOND, None, 0.018, 0.002, 1)
PLAIN = AlarmRules()


def recorded(journal: Journal, alarm: Alarm = RAISED, rules: AlarmRules = PLAIN) -> int:
    (number,) = journal.record([AlarmEntry(AXIS, "N m s/rad", 0.06, alarm, rules)])
    return number


def ended(seconds: int, alarm: Alarm = RAISED) -> Alarm:
    return replace(alarm, ended_us=seconds * SECOND)


def by(who: str, seconds: int, comment: str = "", work_order: str = "") -> Note:
    return Note(seconds * SECOND, who, comment, work_order)


def state(journal: Journal, number: int) -> AlarmLife:
    """As the row has it, which is what its transitions make."""
    alarm = journal.get(number)
    assert alarm is not None
    assert replayed((t.event, t.until_us) for t in journal.transitions(number)) == alarm.life
    return alarm.life


def test_an_alarm_from_its_raising_to_the_work_order(journal: Journal) -> None:
    number = recorded(journal)
    journal.act(number, E.ACKNOWLEDGE, by("anna", 5, "I look at it"))
    assert recorded(journal, ended(9)) == number
    assert state(journal, number) == AlarmLife()
    after = journal.act(number, E.COMMENT, by("otto", 20, "gearbox changed", "WO-17"))
    assert (after.work_order, after.active) == ("WO-17", False)
    found = [(t.at_us // SECOND, t.event, t.from_state, t.to_state, t.who) for t in journal.transitions(number)]
    assert found == [
        (2, "raise", "normal", "unacknowledged", "axiswatch"),
        (5, "acknowledge", "unacknowledged", "acknowledged", "anna"),
        (9, "clear", "acknowledged", "normal", "axiswatch"),
        (20, "comment", "normal", "normal", "otto"),
    ]
    assert [(t.comment, t.work_order) for t in journal.transitions(number)][1::2] == [
        ("I look at it", ""),
        ("gearbox changed", "WO-17"),
    ]


def test_each_step_of_its_name_has_the_time_of_its_own(journal: Journal) -> None:
    """Crossed again in the block in which it is named; then the name stays, and is in doubt for a while."""
    number = recorded(journal)
    named = RAISED.named(4 * SECOND, "fm", "up")
    recorded(journal, named.detected_again(5 * SECOND))
    recorded(journal, doubtful := named.named(60 * SECOND, "fm", "up", doubt="several"))
    recorded(journal, doubtful.detected_again(70 * SECOND))
    recorded(journal, doubtful.named(80 * SECOND, "fm", "up", doubt=""))
    found = [(t.at_us // SECOND, t.event) for t in journal.transitions(number)]
    assert found == [(2, "raise"), (4, "name"), (60, "name"), (80, "name")]


def test_what_is_not_possible_changes_nothing(journal: Journal) -> None:
    number = recorded(journal)
    journal.act(number, E.ACKNOWLEDGE, by("anna", 5))
    before = journal.transitions(number), journal.get(number)
    with pytest.raises(AlarmTransitionError, match="the alarm is acknowledged"):
        journal.act(number, E.ACKNOWLEDGE, by("otto", 6))
    with pytest.raises(ShelfEndError):
        journal.act(number, E.SHELVE, by("otto", 6), 5 * SECOND)
    with pytest.raises(UnknownAlarmError):
        journal.act(number + 1, E.ACKNOWLEDGE, by("otto", 6))
    assert (journal.transitions(number), journal.get(number)) == before


def test_state_and_transition_are_one_transaction(journal: Journal, tmp_path: Path) -> None:
    """The disk takes what a person has done, and refuses what becomes of the alarm."""
    number, revision = recorded(journal), journal.revision
    with sqlite3.connect(tmp_path / "alarms.sqlite") as other:
        other.execute(
            "CREATE TRIGGER full BEFORE UPDATE OF state ON alarm BEGIN SELECT RAISE(ABORT, 'disk is full'); END"
        )
    other.close()
    with pytest.raises(StoreError, match="disk is full"):
        journal.act(number, E.ACKNOWLEDGE, by("anna", 5))
    with pytest.raises(StoreError, match="disk is full"):
        journal.services.change(AXIS, E.REMOVE, by("anna", 5))
    assert journal.services.removed() == {}
    assert state(journal, number) == AlarmLife(S.UNACKNOWLEDGED)
    assert len(journal.transitions(number)) == 1
    assert journal.revision == revision


def test_a_shelf_ends_by_itself_and_the_cause_is_followed(journal: Journal) -> None:
    number = recorded(journal)
    journal.act(number, E.SHELVE, by("anna", 5, "spare part on its way"), 60 * SECOND)
    journal.end_shelves(59 * SECOND)
    assert state(journal, number) == AlarmLife(S.SHELVED, S.UNACKNOWLEDGED, 60 * SECOND)
    assert [a.id for a in journal.query(AlarmFilter(active=True))[0]] == [number]
    journal.end_shelves(61 * SECOND)
    assert state(journal, number) == AlarmLife(S.UNACKNOWLEDGED)
    last = journal.transitions(number)[-1]
    assert (last.at_us, last.event, last.who) == (60 * SECOND, "shelf ended", "axiswatch")


def test_a_shelf_of_a_clock_that_was_far_ahead_ends_when_the_clock_is_right(journal: Journal) -> None:
    number, day = recorded(journal), 86_400
    journal.act(number, E.SHELVE, by("anna", 7 * day), 14 * day * SECOND)
    journal.end_shelves((7 * day - 60) * SECOND)  # it was set back by a minute
    assert state(journal, number).hidden
    journal.end_shelves(5 * day * SECOND)
    assert state(journal, number) == AlarmLife(S.UNACKNOWLEDGED)
    assert journal.transitions(number)[-1].at_us == 5 * day * SECOND


def test_a_person_may_act_when_the_shelf_is_over_but_its_end_is_not_recorded(journal: Journal) -> None:
    number = recorded(journal)
    journal.act(number, E.SHELVE, by("anna", 5), 60 * SECOND)
    assert journal.act(number, E.ACKNOWLEDGE, by("anna", 70)).state == "acknowledged"
    assert [t.event for t in journal.transitions(number)][2:] == ["shelf ended", "acknowledge"]


def test_the_next_alarm_of_that_name_is_shelved_too_and_unshelving_shows_all(journal: Journal) -> None:
    first = recorded(journal)
    journal.act(first, E.SHELVE, by("anna", 3), 60 * SECOND)
    recorded(journal, ended(4))
    again = replace(RAISED, raised_us=10 * SECOND, updated_us=10 * SECOND)
    second = recorded(journal, again)
    other = recorded(journal, replace(again, direction="down"))
    assert state(journal, second) == AlarmLife(S.SHELVED, S.UNACKNOWLEDGED, 60 * SECOND)
    assert journal.transitions(second)[-1].comment == f"as alarm {first}, which is shelved"
    assert state(journal, other) == AlarmLife(S.UNACKNOWLEDGED)
    journal.act(second, E.UNSHELVE, by("anna", 20))
    assert (state(journal, first), state(journal, second)) == (AlarmLife(), AlarmLife(S.UNACKNOWLEDGED))
    late = replace(RAISED, raised_us=70 * SECOND, updated_us=70 * SECOND)
    recorded(journal, ended(30, again))
    journal.act(first, E.SHELVE, by("anna", 40), 60 * SECOND)
    assert state(journal, recorded(journal, late)) == AlarmLife(S.UNACKNOWLEDGED)


def test_a_cause_that_went_and_came_back_while_the_disk_was_full_is_unacknowledged(journal: Journal) -> None:
    number = recorded(journal)
    journal.act(number, E.ACKNOWLEDGE, by("anna", 5))
    assert recorded(journal, replace(RAISED, reopened_us=8 * SECOND, crossings=2)) == number
    assert recorded(journal, replace(RAISED, reopened_us=8 * SECOND, crossings=3)) == number
    assert state(journal, number) == AlarmLife(S.UNACKNOWLEDGED)
    assert [t.event for t in journal.transitions(number)] == ["raise", "acknowledge", "clear", "raise"]


def test_rules_of_the_configuration_hold_at_once_and_after_a_change_of_it(journal: Journal) -> None:
    hidden = recorded(journal, rules=AlarmRules("high", suppressed=True))
    assert state(journal, hidden) == AlarmLife(S.SUPPRESSED, S.UNACKNOWLEDGED)
    assert [t.who for t in journal.transitions(hidden)] == ["configuration", "axiswatch"]
    with pytest.raises(AlarmTransitionError, match=r"\[robot.axis.alarms\]"):
        journal.act(hidden, E.ACKNOWLEDGE, by("anna", 5))
    rules = AlarmRules("low", latched=True)
    journal.apply_rules({(AXIS, "kT"): AlarmRules("high"), (AXIS, "fm"): rules}, 6 * SECOND)
    assert state(journal, hidden) == AlarmLife(S.UNACKNOWLEDGED)
    recorded(journal, ended(9), rules)
    alarm = journal.get(hidden)
    assert alarm is not None
    assert (alarm.state, alarm.active, alarm.priority, alarm.ended_us) == ("latched", True, "low", 9 * SECOND)
    assert journal.query(AlarmFilter(active=True))[1] == 1
    journal.act(hidden, E.ACKNOWLEDGE, by("anna", 10))
    assert (journal.query(AlarmFilter(active=True))[1], journal.query(AlarmFilter(active=False))[1]) == (0, 1)


def test_an_old_journal_keeps_its_alarms_and_the_active_ones_become_unacknowledged(tmp_path: Path) -> None:
    path = tmp_path / "alarms.sqlite"
    old = sqlite3.connect(path)
    before = MIGRATIONS[: MIGRATIONS.index(MIGRATION)]
    for migration in before:
        old.executescript(migration)
    old.execute(f"PRAGMA user_version={len(before)}")
    columns = "axis, parameter, direction, unit, onset_us, raised_us, updated_us, ended_us, crossings, first_parameter"
    for raised, gone in ((2, 3), (5, None)):
        values = (AXIS, "fm", "up", "1", 1, raised, raised, gone, 1, "fm")
        old.execute(f"INSERT INTO alarm ({columns}) VALUES ({', '.join('?' * 10)})", values)
    old.commit()
    old.close()
    journal = Journal(path)
    assert [(a.active, state(journal, a.id).state, a.priority) for a in journal.query()[0]] == [
        (True, "unacknowledged", "medium"),
        (False, "normal", "medium"),
    ]
    assert journal.act(2, E.ACKNOWLEDGE, by("anna", 5)).state == "acknowledged"
    journal.close()


def test_a_chattering_axis_is_one_alarm_that_returns_after_the_off_delay(journal: Journal) -> None:
    """Its cause goes and comes back five times; the monitor knows it as the same alarm, the off-delay as lasting."""
    rules, alarm = AlarmRules(off_delay_s=30), RAISED
    journal.apply_rules({(AXIS, "fm"): rules}, 0)
    number = recorded(journal, alarm, rules)
    journal.act(number, E.ACKNOWLEDGE, by("anna", 5))
    for k in range(1, 6):
        alarm = ended(20 * k, alarm)
        assert recorded(journal, alarm, rules) == number
        journal.end_shelves((20 * k + 9) * SECOND)
        alarm = replace(alarm, ended_us=None, reopened_us=(20 * k + 10) * SECOND, crossings=k + 1)
        assert recorded(journal, alarm, rules) == number
    assert [t.event for t in journal.transitions(number)] == ["raise", "acknowledge"]
    recorded(journal, ended(120, alarm), rules)
    journal.apply_rules({(AXIS, "fm"): rules}, 149 * SECOND)
    journal.end_shelves(149 * SECOND)
    assert state(journal, number) == AlarmLife(S.ACKNOWLEDGED)
    journal.apply_rules({(AXIS, "fm"): rules}, 170 * SECOND)  # as at the next start
    assert state(journal, number) == AlarmLife()
    last = journal.transitions(number)[-1]
    assert (last.at_us, last.event) == (150 * SECOND, "clear")
    assert journal.statistics(0, 200 * SECOND).raised == 1


def test_a_cause_that_is_back_after_the_off_delay_is_raised_again(journal: Journal) -> None:
    """Nobody has looked meanwhile, as with a backlog; and then without the record of its end, as the disk was full."""
    rules = AlarmRules(off_delay_s=5)
    number = recorded(journal, RAISED, rules)
    recorded(journal, ended(9), rules)
    alarm = replace(RAISED, reopened_us=14 * SECOND, updated_us=14 * SECOND)
    recorded(journal, alarm, rules)
    recorded(journal, replace(alarm, reopened_us=18 * SECOND, updated_us=18 * SECOND), rules)
    recorded(journal, replace(alarm, reopened_us=24 * SECOND, updated_us=24 * SECOND), rules)
    events = [(t.at_us // SECOND, t.event) for t in journal.transitions(number)]
    assert events == [(2, "raise"), (14, "clear"), (14, "raise"), (24, "clear"), (24, "raise")]


def test_an_axis_out_of_service_announces_nothing_and_comes_back_as_it_is(journal: Journal, tmp_path: Path) -> None:
    rules = {(AXIS, "fm"): PLAIN, (AXIS, "kT"): AlarmRules(suppressed=True)}
    journal.apply_rules(rules, 0)
    fm, gone = recorded(journal), recorded(journal, replace(RAISED, parameter="Ja"))
    other = journal.record([AlarmEntry("demo.axis2", "1", 1.0, RAISED)])[0]
    journal.services.change(AXIS, E.REMOVE, by("anna", 5, "gearbox is changed", "WO-9"))
    kT = recorded(journal, replace(RAISED, parameter="kT", raised_us=6 * SECOND), rules[AXIS, "kT"])
    recorded(journal, ended(7, replace(RAISED, parameter="Ja")))
    for number in (fm, kT):
        assert state(journal, number) == AlarmLife(S.OUT_OF_SERVICE, S.UNACKNOWLEDGED)
    assert (state(journal, gone), state(journal, other).state) == (AlarmLife(), "unacknowledged")
    removed = [t for t in journal.transitions(fm) if t.event is E.REMOVE]
    assert [(t.at_us, t.who, t.comment) for t in removed] == [(5 * SECOND, "anna", "gearbox is changed")]
    assert [(t.event, t.who) for t in journal.transitions(kT)] == [
        ("remove from service", "anna"), ("raise", "axiswatch"),
    ]  # fmt: skip
    with pytest.raises(AlarmTransitionError, match=r"demo\.axis1 is out of service already, since .* by anna"):
        journal.services.change(AXIS, E.REMOVE, by("otto", 8))
    with pytest.raises(AlarmTransitionError, match="its axis is out of service"):
        journal.act(fm, E.ACKNOWLEDGE, by("otto", 8))
    journal.close()
    again = Journal(tmp_path / "alarms.sqlite")  # the next start
    again.apply_rules(rules, 9 * SECOND)
    assert again.services.removed() == {AXIS: by("anna", 5, "gearbox is changed", "WO-9")}
    assert state(again, fm).state == "out-of-service"
    again.services.change(AXIS, E.RETURN, by("otto", 10))
    assert (state(again, fm).state, state(again, kT).state) == ("unacknowledged", "suppressed")
    assert [(s.event, s.note.who) for s in again.services.steps(AXIS)] == [
        ("remove from service", "anna"), ("return to service", "otto"),
    ]  # fmt: skip
    with pytest.raises(AlarmTransitionError, match=r"no person has taken demo\.axis1 out of service"):
        again.services.change(AXIS, E.RETURN, by("otto", 11))
    assert again.services.removed() == {}
    again.close()


def test_the_first_alarm_of_a_robot_is_first_out_while_others_that_followed_are_there(
    journal: Journal,
) -> None:
    def raised(axis: str, second: int, parameter: str = "fm") -> int:
        alarm = replace(RAISED, parameter=parameter, raised_us=second * SECOND, updated_us=second * SECOND)
        return journal.record([AlarmEntry(axis, "1", 1.0, alarm)])[0]

    def marks() -> dict[int, tuple[bool, int | None]]:
        return {a.id: (a.first_out, a.follows) for a in journal.query()[0]}

    def end(axis: str, second: int) -> None:
        at = second * SECOND
        journal.record(
            [AlarmEntry(axis, "1", 1.0, replace(RAISED, raised_us=at, updated_us=at, ended_us=9000 * SECOND))]
        )

    first = raised("cell.a", 100)
    same = raised("cell.a", 150, "kT")
    assert marks() == {first: (False, None), same: (False, first)}  # of one axis alone
    second, alien = raised("cell.b", 200), raised("cell2.b", 201)
    late = raised("cell.c", 801)  # more than ten minutes after the last one
    followed = {first: (True, None), same: (False, first), second: (False, first), alien: (False, None)}
    assert marks() == followed | {late: (False, None)}
    journal.act(second, E.SHELVE, by("anna", 900), 5000 * SECOND)
    assert marks()[first] == (False, None)
    journal.act(second, E.UNSHELVE, by("anna", 901))
    assert marks()[first] == (True, None)
    end("cell.a", 100)
    assert marks()[first] == (False, None)
    assert marks()[second] == (False, first)  # it was not first, though it is the only one now


def test_axes_of_a_robot_that_show_the_same_payload_name_each_other(journal: Journal) -> None:
    """A load that is up is a torque constant that is down, where that may be a payload; within ten minutes."""
    payload = Cause("kT", 0.97, ("load",))

    def raised(axis: str, second: int, name: str, way: Direction, *causes: Cause, doubt: Doubt = "") -> None:
        at = second * SECOND
        named = replace(
            RAISED,
            parameter=name,
            direction=way,
            stage="named",
            causes=causes,
            raised_us=at,
            updated_us=at,
            doubt=doubt,
        )
        journal.record([AlarmEntry(axis, "1", 1.0, named)])

    raised("cell.a", 1000, "kT", "down", payload)
    raised("cell.b", 1100, "load", "up", Cause("load", 0.99))
    raised("cell.c", 1200, "inertia", "up", Cause("inertia", 0.99))
    raised("cell.d", 1001, "kT", "up", payload)  # a lighter one
    raised("cell.e", 1001, "kT", "down", Cause("kT", 0.99))  # bears no weight
    raised("cell.f", 1001, "fm", "up", Cause("fm", 0.9), Cause("load", 0.1))
    raised("cell.g", 1001, "kT", "down", payload, doubt="model")  # a sensor is likelier
    raised("cell.i", 1650, "load", "up", Cause("load", 0.99), doubt="several")  # of the same as b, c and h
    raised("cell.h", 1700, "load", "up", Cause("load", 0.99))  # later: of b and c, but not of a
    raised("cell2.a", 1001, "kT", "down", payload)  # another robot
    raised("cell.a", 1002, "inertia", "up", Cause("inertia", 0.99))  # of the same axis

    found = {(a.axis, a.parameter): a.same_payload for a in journal.query()[0]}
    assert found[("cell.a", "kT")] == found[("cell.a", "inertia")] == ("cell.b", "cell.c")
    assert found[("cell.b", "load")] == ("cell.a", "cell.c", "cell.h", "cell.i")
    assert found[("cell.h", "load")] == ("cell.b", "cell.c", "cell.i")
    assert found[("cell.i", "load")] == ("cell.b", "cell.c", "cell.h")
    others = {axis: axes for (axis, _), axes in found.items() if axis[-1] in "defg" or axis == "cell2.a"}
    assert set(others.values()) == {()}
    assert len(others) == 5


def test_what_a_base_feels_of_a_payload_names_the_axes_that_show_it(journal: Journal) -> None:
    at = 1000 * SECOND
    onset = {"onset_us": at, "onset_low_us": at - SECOND, "onset_high_us": at + SECOND}
    named = replace(RAISED, stage="named", raised_us=at, updated_us=at, doubt="", **onset)  # type: ignore[arg-type]
    base, arm = replace(named, parameter="fc", direction="down"), replace(named, parameter="load", direction="up")
    journal.record([AlarmEntry("cell.base", "1", 1.0, base), AlarmEntry("cell.arm", "1", 1.0, arm)])
    assert {a.axis: a.same_payload for a in journal.query()[0]} == {"cell.base": ("cell.arm",), "cell.arm": ()}


def test_the_first_of_a_group_is_first_out_whatever_their_robots(journal: Journal) -> None:
    for second, axis in enumerate(("cell.a", "cell2.b", "cell.c")):
        alarm = replace(RAISED, raised_us=second * SECOND, updated_us=second * SECOND)
        journal.record([AlarmEntry(axis, "1", 1.0, alarm)])

    def marks() -> list[tuple[bool, int | None]]:
        return [(a.first_out, a.follows) for a in sorted(journal.query()[0], key=lambda a: a.id)]

    assert marks() == [(True, None), (False, None), (False, 1)]
    journal.group({"cell.a": "line", "cell2.b": "line"})
    assert marks() == [(True, None), (False, 1), (False, None)]


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.one_of(
            st.sampled_from([E.ACKNOWLEDGE, E.SHELVE, E.UNSHELVE, E.COMMENT]),
            st.builds(
                AlarmRules,
                latched=st.booleans(),
                suppressed=st.booleans(),
                off_delay_s=st.sampled_from([0.0, 3.0]),
            ),
            st.booleans(),
        ),
        max_size=12,
    )
)
def test_whatever_happens_the_journal_replayed_gives_the_state(
    journal: Journal, steps: list[AlarmEvent | AlarmRules | bool]
) -> None:
    """Rules: the cause comes or goes under them.  True and False: its axis is taken out of service, or returned."""
    alarm = replace(RAISED, parameter=f"p{journal.revision}")
    with suppress(AlarmTransitionError):
        journal.services.change(AXIS, E.RETURN, by("anna", 9))  # the example before may have taken it out
    number, at = recorded(journal, alarm), 10
    for step in steps:
        at += 2
        if isinstance(step, AlarmRules):
            gone = alarm.ended_us is None
            when = at * SECOND
            alarm = replace(alarm, ended_us=when if gone else None, reopened_us=None if gone else when)
            assert recorded(journal, alarm, step) == number
            assert state(journal, number).active or alarm.ended_us is not None
        elif isinstance(step, bool):
            with suppress(AlarmTransitionError):
                journal.services.change(AXIS, E.REMOVE if step else E.RETURN, by("anna", at))
                assert (state(journal, number).state == "out-of-service") == (step and state(journal, number).active)
        else:
            with suppress(AlarmTransitionError):
                journal.act(number, step, by("anna", at), (at + 3) * SECOND if step is E.SHELVE else None)
        state(journal, number)


# --- statistics ---------------------------------------------------------------------------------------------


def test_rates_floods_and_the_most_frequent(journal: Journal) -> None:
    """Two hours: eleven alarms in ten minutes, a flood; and a suppressed one, which is raised but not announced."""
    for k in range(11):
        e = replace(RAISED, parameter=f"p{k % 3}", raised_us=(1200 + 60 * k) * SECOND - k)
        recorded(journal, replace(e, ended_us=e.raised_us + 1))
    recorded(journal, replace(RAISED, raised_us=3000 * SECOND), AlarmRules("high", suppressed=True))
    recorded(journal, replace(RAISED, direction="down", raised_us=7200 * SECOND))
    found = journal.statistics(0, 7200 * SECOND)
    assert (found.raised, found.announced) == (12, 11)
    assert found.mean_per_ten_minutes == pytest.approx(11 / 12)
    assert (found.most_in_ten_minutes, found.most_at_us, found.flood_share) == (11, 1200 * SECOND, 1 / 12)
    names = [(f.parameter, f.direction, f.alarms) for f in found.most_frequent]
    assert names == [("p0", "up", 4), ("p1", "up", 4), ("p2", "up", 3), ("fm", "up", 1)]
    shifted = journal.statistics(1199 * SECOND + 20, 7200 * SECOND)
    assert (shifted.most_in_ten_minutes, shifted.flood_share) == (10, 0)
    counts = {(c.state, c.priority): c.alarms for c in found.states}
    assert counts == {("returned", "medium"): 11, ("suppressed", "high"): 1, ("unacknowledged", "medium"): 1}
    assert journal.statistics(0, 1).most_at_us is None


def test_stale_chattering_and_shelved_alarms_are_found(journal: Journal) -> None:
    day = 86_400
    old = recorded(journal, replace(RAISED, parameter="kT"))
    shelved = recorded(journal, replace(RAISED, parameter="Ja"))
    journal.act(shelved, E.SHELVE, by("anna", 5), day * SECOND)
    numbers = []
    for k in range(4):
        e = replace(RAISED, raised_us=(day + (300, 700, 900, 2000)[k]) * SECOND)
        numbers.append(recorded(journal, replace(e, ended_us=e.raised_us + SECOND)))

    def found(name: str, now: int = day + 3000) -> list[int]:
        return [a.id for a in journal.query(AlarmFilter(state=name), now_us=now * SECOND)[0]]  # type: ignore[arg-type]

    assert found("chattering") == [numbers[2]]
    assert (found("stale"), found("stale", day + 1)) == ([old], [])
    assert found("shelved") == [shelved]
    assert found("returned") == numbers[::-1]
    assert found("active") == [shelved, old]
    assert [a.id for a in journal.standing()] == [old, shelved]


@pytest.mark.parametrize(
    "wanted",
    [
        *(AlarmFilter(state=state) for state in (*AlarmState, "active", "stale")),
        *(AlarmFilter(active=active) for active in (True, False)),
        *(AlarmFilter("demo.axis2", parameter) for parameter in (None, "fm", "Ja")),
        *(AlarmFilter(since_us=k * SECOND, until_us=until) for k in (2, 3, 4) for until in (None, 4 * SECOND)),
    ],
    ids=str,
)
def test_the_journal_and_alarms_not_yet_in_it_are_filtered_alike(journal: Journal, wanted: AlarmFilter) -> None:
    for axis in (AXIS, "demo.axis2"):
        for seconds, parameter in ((2, "kT"), (3, "Ja"), (4, "fm"), (5, "gT")):
            alarm = replace(RAISED, parameter=parameter, raised_us=seconds * SECOND)
            number = journal.record([AlarmEntry(axis, "", 1.0, alarm, PLAIN)])[0]
            match parameter:
                case "fm":
                    journal.act(number, E.ACKNOWLEDGE, by("anna", 6))
                case "Ja":
                    journal.act(number, E.SHELVE, by("anna", 6), 3 * 86_400 * SECOND)
                case "kT":
                    journal.record([AlarmEntry(axis, "", 1.0, replace(alarm, ended_us=7 * SECOND), PLAIN)])
    now_us = (86_400 + 4) * SECOND
    every = journal.query(now_us=now_us)[0]
    assert journal.query(wanted, now_us=now_us)[0] == [a for a in every if wanted.matches(a, now_us)]
