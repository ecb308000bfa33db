"""Live events from a real server: axes that change, transitions of alarms, resumed; few streams, which end."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import httpx
import pytest

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmEvent
from service.store.alarm_transitions import Note
from service.store.tokens import Scope, TokenFile
from service.web import event_stream, gate, models
from service.web.access import Access
from tests.end_to_end.processes import PATIENCE_S
from tests.service.web.conftest import NOON_US, Daemon, Stage, monitored_axis, serving

NOTE = Note(NOON_US, "anna")


class Event(NamedTuple):
    kind: str
    data: Any
    number: str | None


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_stream, "EVERY_S", 0.02)


@contextmanager
def stream(address: str, query: str = "", **headers: str) -> Iterator[Iterator[Event]]:
    """The events of a new stream; comments are events without data."""
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    with httpx.stream("GET", f"{address}/api/v1/events{query}", headers=sent, timeout=PATIENCE_S) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield _events(answer.iter_lines())


def _events(lines: Iterator[str]) -> Iterator[Event]:
    fields: dict[str, str] = {}
    for line in lines:
        name, _, value = line.partition(": ")
        if line:
            fields[name] = value
        else:
            data = json.loads(fields["data"]) if "data" in fields else None
            yield Event(fields.get("event", "comment"), data, fields.get("id"))
            fields = {}


def next_of(events: Iterator[Event], kind: str) -> Event:
    return next(event for event in events if event.kind == kind)


def test_axes_come_all_at_first_and_then_those_that_change(stage: Stage) -> None:
    stage.healthy()
    with serving(stage) as address, stream(address) as events:
        first = next(events)
        assert (first.kind, first.number) == ("axes", None)
        assert first.data == httpx.get(f"{address}/api/v1/axes", timeout=PATIENCE_S).json()
        axes = stage.snapshot.axes
        gated = replace(axes[1], gated_by="mode = 2")
        stage.snapshot = replace(stage.snapshot, taken_us=NOON_US + 1, axes=(replace(axes[0]), gated))
        second = next(events)
        assert [a["id"] for a in second.data["axes"]] == ["demo.axis2"]
        assert second.data["axes"][0]["gated_by"] == "mode = 2"
        models.Axes.model_validate(second.data)


def test_of_many_axes_that_change_each_has_its_turn(stage: Stage) -> None:
    stage.snapshot = replace(stage.snapshot, axes=tuple(monitored_axis(f"axis{k}") for k in range(130)))
    with serving(stage) as address, stream(address) as events:
        assert len(next(events).data["axes"]) == 130
        for turn in range(2):
            axes = tuple(replace(a, gated_by=f"x = {turn}") for a in stage.snapshot.axes)
            stage.snapshot = replace(stage.snapshot, taken_us=NOON_US + 1 + turn, axes=axes)
            sent = [next(events).data["axes"] for _ in range(3)]
            assert [len(some) for some in sent] == [50, 50, 30]
            assert {a["id"] for some in sent for a in some} == {a.id for a in axes}
            assert {a["gated_by"] for some in sent for a in some} == {f"x = {turn}"}


def test_only_an_axis_and_its_alarms(stage: Stage, fm_alarm: Alarm) -> None:
    stage.healthy()
    with serving(stage) as address:
        assert httpx.get(f"{address}/api/v1/events?axis=demo.axis9", timeout=PATIENCE_S).status_code == 404
        with stream(address, "?axis=demo.axis2", last_event_id="0") as events:
            assert [a["id"] for a in next(events).data["axes"]] == ["demo.axis2"]
            stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
            stage.record("demo.axis2", "N m s/rad", 0.06, fm_alarm)
            alarm = next(events)
            assert (alarm.data["alarm"]["axis"], alarm.number) == ("demo.axis2", "2")


def test_each_transition_of_an_alarm_is_an_event_and_none_is_missed(stage: Stage, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    with serving(stage) as address:
        with stream(address) as events:
            next_of(events, "axes")
            stage.journal.act(number, AlarmEvent.ACKNOWLEDGE, NOTE)
            alarm = next_of(events, "alarm")
            assert alarm.number == "2", "what was there before is not sent"
            assert alarm.data["transition"]["event"] == "acknowledge"
            assert alarm.data["transition"]["who"] == "anna"
            (listed,) = httpx.get(f"{address}/api/v1/alarms", timeout=PATIENCE_S).json()["alarms"]
            assert alarm.data["alarm"] == listed
            models.AlarmChange.model_validate(alarm.data)
        for k in range(250):
            stage.journal.act(number, AlarmEvent.COMMENT, NOTE._replace(comment=f"comment {k}"))
        with stream(address, last_event_id="2") as events:
            found = [next_of(events, "alarm") for _ in range(250)]
            assert [event.number for event in found] == [str(k) for k in range(3, 253)]
            assert [e.data["transition"]["comment"] for e in found] == [f"comment {k}" for k in range(250)]
            stage.journal.act(number, AlarmEvent.COMMENT, NOTE._replace(comment="last"))
            assert next_of(events, "alarm").number == "253"
        # The journal was damaged, and began again.
        with stream(address, last_event_id="900") as events:
            next_of(events, "axes")
            stage.journal.act(number, AlarmEvent.COMMENT, NOTE._replace(comment="new"))
            assert next_of(events, "alarm").number == "254"
        refused = httpx.get(f"{address}/api/v1/events", headers={"last-event-id": "x"}, timeout=PATIENCE_S)
        assert refused.status_code == 422


def test_a_comment_keeps_a_silent_stream_alive(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_stream, "KEEP_ALIVE_S", 0.05)
    with serving(stage) as address, stream(address) as events:
        assert [next(events).kind for _ in range(3)] == ["axes", "comment", "comment"]


def test_streams_are_few_and_their_places_become_free(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_stream, "MOST_STREAMS", 2)
    with serving(stage) as address:
        with stream(address) as first, stream(address) as second:
            next(first), next(second)
            refused = httpx.get(f"{address}/api/v1/events", timeout=PATIENCE_S)
            assert (refused.status_code, refused.headers["retry-after"]) == (503, "10")
            assert httpx.get(f"{address}/api/v1/axes", timeout=PATIENCE_S).status_code == 200
        for _ in range(500):
            with httpx.stream("GET", f"{address}/api/v1/events", timeout=PATIENCE_S) as answer:
                if answer.status_code == 200:
                    break
        assert answer.status_code == 200


def test_a_stream_ends_with_the_daemon(stage: Stage) -> None:
    daemon = Daemon(stage)
    with stream(daemon.url) as events:
        next(events)
        daemon.stop()
        assert list(events) == [], "it is closed as it should be: httpx fails where it is cut"


@pytest.mark.parametrize("with_token", [True, False])
def test_a_stream_ends_when_its_caller_is_no_longer_known(stage: Stage, tmp_path: Path, with_token: bool) -> None:
    """Its token is revoked, or it had none and one is needed now."""
    tokens = TokenFile(tmp_path / "tokens.json")
    headers = {"Authorization": f"Bearer {tokens.new('anna', Scope.READ)}"} if with_token else {}
    stage.access = Access(tokens)
    with serving(stage) as address, stream(address, **headers) as events:
        next(events)
        if with_token:
            tokens.revoke("anna")
        else:
            tokens.new("ben", Scope.READ)
        assert next(events, None) is None


def test_a_client_that_does_not_read_is_cut_off(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """It gets what fits into the buffers; then its place is free for another."""
    monkeypatch.setattr(event_stream, "MOST_STREAMS", 1)
    monkeypatch.setattr(event_stream, "EVERY_S", 0.001)
    stage.snapshot = replace(stage.snapshot, axes=tuple(monitored_axis(f"axis{k}") for k in range(50)))
    done = threading.Event()

    def change() -> None:
        while not done.wait(0.001):
            stage.snapshot = replace(
                stage.snapshot,
                axes=tuple(replace(a, gated_by="" if a.gated_by else "x") for a in stage.snapshot.axes),
            )

    changing = threading.Thread(target=change)
    changing.start()
    try:
        with serving(stage) as address:
            host, _, port = address.removeprefix("http://").partition(":")
            httpx.get(f"{address}/healthz", timeout=PATIENCE_S).raise_for_status()  # the first takes longer
            monkeypatch.setattr(gate, "LONGEST_REQUEST_S", 0.5)
            with socket.socket() as deaf:
                deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                deaf.connect((host, int(port)))
                deaf.sendall(b"GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
                assert deaf.recv(12) == b"HTTP/1.1 200"
                for _ in range(1000):
                    with httpx.stream("GET", f"{address}/api/v1/events", timeout=PATIENCE_S) as answer:
                        if answer.status_code == 200:
                            break
                    done.wait(0.02)
                assert answer.status_code == 200, "the only place is free though the first is still connected"
    finally:
        done.set()
        changing.join()
