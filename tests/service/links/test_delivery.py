"""What was promised to a link is delivered in order, at least once, or given up and counted."""

import math
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import structlog
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from monitor_core.monitoring import AlarmEvent, AlarmRules
from monitor_core.wording import Sentence
from service.links.delivery import (
    LAST_RETRY_S,
    LONGEST_REQUESTED_S,
    PAGE,
    NotYetError,
    RefusedError,
    UnavailableError,
    answers,
)
from service.store.alarm_transitions import Note
from service.store.journal import Journal
from service.store.outbox import Outbox
from tests.service.links.journals import NAMED, NOON_US, SECOND, Inbox, Post, alarms, comment, record


@pytest.fixture
def post(tmp_path: Path) -> Iterator[Post]:
    opened = Post(tmp_path, Inbox())
    yield opened
    opened.close()


def test_a_message_names_the_recording_as_soon_as_there_is_one(tmp_path: Path) -> None:
    post = Post(tmp_path, Inbox())
    number = record(post.journal)
    post.settle()
    post.recording = "frames.log"
    comment(post.journal, number)
    post.settle()
    assert [m.recording for m in post.inbox.got] == [None, "frames.log"]
    post.close()


def test_each_transition_is_delivered_once_in_order(post: Post) -> None:
    assert post.settle() == math.inf
    number = record(post.journal)
    post.journal.act(number, AlarmEvent.ACKNOWLEDGE, Note(NOON_US + 3 * SECOND, "anna", "I look at it"))
    record(post.journal, NAMED)
    record(post.journal, replace(NAMED, ended_us=NOON_US + 9 * SECOND))
    assert post.settle() == math.inf
    assert post.inbox.events == ["axis1 raise", "axis1 acknowledge", "axis1 name", "axis1 clear"]
    assert [m.transition.at_us - NOON_US for m in post.inbox.got] == [0, 3e6, 4e6, 9e6]
    assert post.inbox.got[1].transition.who == "anna"
    assert len({m.id for m in post.inbox.got}) == 4
    assert post.delivery.snapshot.delivered == 4
    assert post.settle() == math.inf
    assert len(post.inbox.got) == 4


def test_the_alarm_is_as_it_is_when_it_is_sent(post: Post) -> None:
    record(post.journal)
    post.inbox.failures = [UnavailableError("down")]
    post.settle()
    record(post.journal, NAMED)
    post.wait(1.0)
    post.settle()
    assert [(m.transition.event, m.alarm.parameter) for m in post.inbox.got] == [
        ("raise", "fm"),
        ("name", "fm"),
    ]


def test_a_renamed_alarm_is_delivered_and_the_same_name_is_not(post: Post) -> None:
    record(post.journal)
    record(post.journal, NAMED)
    record(post.journal, replace(NAMED, crossings=7, updated_us=NOON_US + 8 * SECOND))
    record(post.journal, replace(NAMED, doubt="model"))
    post.settle()
    assert post.inbox.events == ["axis1 raise", "axis1 name", "axis1 name"]


def test_a_link_that_is_down_tries_again_more_and_more_seldom(post: Post) -> None:
    alarms(post.journal, 2)
    post.inbox.failures = [UnavailableError(f"down {k}") for k in range(12)]
    waits = list[float]()
    with structlog.testing.capture_logs() as logs:
        while post.inbox.failures:
            waits.append(post.settle())
            assert post.delivery.snapshot.connected is False
            assert post.delivery.snapshot.problem == f"down {len(waits) - 1}"
            assert post.delivery.snapshot.pending == 2
            post.wait(waits[-1] / 2)
            assert post.settle() == pytest.approx(waits[-1] / 2)  # not before its time
            post.wait(waits[-1] / 2)
        assert post.settle() == math.inf
    assert waits == [1, 2, 4, 8, 16, 32, 64, 128, 256, *3 * [LAST_RETRY_S]]
    assert [entry["event"] for entry in logs] == ["a link is down", "a link is up"]
    assert (post.delivery.snapshot.connected, post.delivery.snapshot.problem) == (True, "")
    assert post.inbox.events == ["axis0 raise", "axis1 raise"]
    post.inbox.failures = [UnavailableError("down")]
    alarms(post.journal, 3)
    assert post.settle() == 1  # from the beginning


@pytest.mark.parametrize("kind", [UnavailableError, RefusedError])
def test_why_a_link_is_down_keeps_its_kind_for_other_languages(
    post: Post, kind: type[UnavailableError | RefusedError]
) -> None:
    alarms(post.journal, 1)
    post.inbox.failures = [kind(answers("orders.example", "503 Service Unavailable"))]
    post.settle()
    problem = post.delivery.snapshot.problem
    assert isinstance(problem, Sentence)
    assert (problem, problem.kind) == ("orders.example answers 503 Service Unavailable", "link answers")


def test_the_time_that_a_receiver_asks_for_is_given_but_not_more_than_an_hour(post: Post) -> None:
    alarms(post.journal, 1)
    post.inbox.failures = [UnavailableError("busy", wait) for wait in (90.0, 0.1, -5.0, 1e9)]
    waits = list[float]()
    for _ in range(4):
        waits.append(post.settle())
        post.clock_s += waits[-1]
    assert waits == [90.0, 2.0, 4.0, LONGEST_REQUESTED_S]


def test_what_is_refused_or_too_old_is_given_up_and_counted(post: Post) -> None:
    alarms(post.journal, 3)
    post.inbox.failures = [RefusedError("404 Not Found")]
    with structlog.testing.capture_logs() as logs:
        post.settle()
        assert post.inbox.events == ["axis1 raise", "axis2 raise"]
        assert post.delivery.snapshot.given_up == {"age": 0, "refused": 1}
        alarms(post.journal, 5)
        post.inbox.failures = [UnavailableError("down")]
        post.settle()
        post.wait(3601.0)
        post.settle()
    assert len(post.inbox.got) == 2
    assert post.delivery.snapshot.given_up == {"age": 2, "refused": 1}
    assert post.delivery.snapshot.pending == 0
    given_up = [(e["reason"], e["transitions"]) for e in logs if e["event"] == "a link gives up"]
    assert given_up == [("refused", 1), ("age", 2)]


def test_a_wall_clock_that_is_set_makes_nothing_older(post: Post) -> None:
    alarms(post.journal, 1)
    post.inbox.failures = [UnavailableError("down"), UnavailableError("down")]
    post.settle()
    for jump_s in (7 * 86400, -14 * 86400):
        post.now_us += jump_s * SECOND
        post.wait(10.0)
        post.settle()
    assert post.delivery.snapshot.given_up["age"] == 0
    assert post.inbox.events == ["axis0 raise"]


def test_what_was_too_old_before_the_start_is_given_up(post: Post) -> None:
    alarms(post.journal, 1)
    post.close()
    post.now_us += 3601 * SECOND
    post.open()
    post.settle()
    assert (post.inbox.got, post.delivery.snapshot.given_up["age"]) == ([], 1)


def test_what_is_not_yet_to_be_sent_is_no_failure(post: Post) -> None:
    alarms(post.journal, 1)
    post.inbox.failures = [NotYetError(30.0)]
    assert post.settle() == 30
    assert post.delivery.snapshot.connected
    post.wait(30.0)
    post.settle()
    assert post.inbox.events == ["axis0 raise"]


def test_other_priorities_are_passed_over_for_good(tmp_path: Path) -> None:
    post = Post(tmp_path, Inbox(), priorities=("high",))
    for axis, priority in (("demo.a", "low"), ("demo.b", "high"), ("demo.c", "medium")):
        record(post.journal, axis=axis, rules=AlarmRules(priority))  # type: ignore[arg-type]
    post.settle()
    assert post.inbox.events == ["b raise"]
    post.close()
    post.priorities = ("low", "medium", "high")
    post.open()
    assert post.settle() == math.inf
    assert len(post.inbox.got) == 1
    post.close()


def test_more_than_is_read_at_once(tmp_path: Path) -> None:
    post = Post(tmp_path, Inbox(most=PAGE))
    number = record(post.journal)
    with closing(sqlite3.connect(post.folder / "alarms.sqlite")) as file, file:
        file.execute(
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1200)"
            " INSERT INTO alarm_transition (alarm_id, at_us, event, from_state, to_state, who, comment, work_order)"
            " SELECT ?, ?, 'comment', 'unacknowledged', 'unacknowledged', 'anna', i, '' FROM n",
            (number, NOON_US),
        )
    post.inbox.failures = [UnavailableError("down")]
    post.settle()
    assert post.delivery.snapshot.pending == 1201
    post.wait(1.0)
    post.settle()
    assert [m.transition.comment for m in post.inbox.got] == ["", *map(str, range(1, 1201))]
    assert post.delivery.snapshot.pending == 0
    post.close()


# --- Over a restart -----------------------------------------------------------------------------------------


def test_what_waits_is_delivered_after_a_restart_with_the_same_ids(post: Post) -> None:
    alarms(post.journal, 3)
    post.step()
    post.inbox.failures = [UnavailableError("down")]
    post.settle()
    post.close()
    post.open()
    post.settle()
    assert post.inbox.events == ["axis0 raise", "axis1 raise", "axis2 raise"]
    first = post.inbox.got[0].id
    post.outbox.done("orders", 0)  # as if the last commit were lost
    post.close()
    post.open()
    post.settle()
    assert post.inbox.got[3].id == first
    assert len({m.id for m in post.inbox.got}) == 3


def test_a_new_link_gets_nothing_of_before(post: Post) -> None:
    alarms(post.journal, 2)
    assert post.outbox.begin(["new", "orders"]) == {"new": 2, "orders": 0}


def test_a_journal_that_replaces_a_damaged_one_is_delivered_from_its_beginning(post: Post) -> None:
    alarms(post.journal, 3)
    post.settle()
    old = post.inbox.got[0].id
    post.close()
    (post.folder / "alarms.sqlite").unlink()
    post.inbox.got.clear()
    post.open()
    alarms(post.journal, 1)
    post.settle()
    assert post.inbox.events == ["axis0 raise"]
    assert post.inbox.got[0].id != old  # else the receiver would drop it
    post.close()
    other = Journal(post.folder / "other.sqlite")
    alarms(other, 2)
    outbox = Outbox(post.folder / "links.sqlite", other)
    assert outbox.begin(["orders"]) == {"orders": 0}
    outbox.close()
    other.close()
    post.open()


def test_a_file_that_cannot_be_written_costs_only_repetitions(post: Post) -> None:
    alarms(post.journal, 2)
    post.outbox.close()
    with structlog.testing.capture_logs() as logs:
        post.settle()
    assert post.inbox.events == ["axis0 raise", "axis1 raise"]
    assert [e["event"] for e in logs] == ["the progress of a link cannot be saved; messages may be repeated"]


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(["raise", "down", "refuse", "restart", "step"]), max_size=30))
def test_nothing_is_left_out_whatever_happens(tmp_path_factory: pytest.TempPathFactory, course: list[str]) -> None:
    post, refused = Post(tmp_path_factory.mktemp("post"), Inbox()), 0
    for number, event in enumerate(course):
        match event:
            case "raise":
                record(post.journal, axis=f"demo.{number}")
            case "down":
                post.inbox.failures.append(UnavailableError("down"))
            case "refuse":
                post.inbox.failures.append(RefusedError("no"))
            case "restart":
                refused += post.delivery.snapshot.given_up["refused"]
                post.close()
                post.open()
            case "step":
                post.step()
    while (left_s := post.step()) < math.inf:
        post.clock_s += left_s
    refused += post.delivery.snapshot.given_up["refused"]
    raised = [f"{number} raise" for number, event in enumerate(course) if event == "raise"]
    assert sorted(post.inbox.events, key=raised.index) == post.inbox.events
    assert len(post.inbox.events) == len(set(post.inbox.events)) == len(raised) - refused
    post.close()
