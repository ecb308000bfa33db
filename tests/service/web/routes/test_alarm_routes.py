"""What persons do about alarms over REST, what is refused and why, and alarms that the disk refuses."""

import json
from dataclasses import replace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmRules
from service.links.mqtt import state_body
from service.pipeline.persistence.alarm_recording import AlarmsSnapshot, as_recorded
from service.store.alarm_entries import AlarmEntry
from service.store.alarm_table import RecordedAlarm
from service.store.alarm_transitions import CONFIGURATION, Note
from tests.service.web.conftest import NOON_US, Stage, with_axis

HOUR_US = 3_600_000_000


@pytest.fixture
def number(stage: Stage, fm_alarm: Alarm) -> int:
    return stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)


def post(client: TestClient, path: str, body: dict[str, Any] | None = None, status: int = 200) -> Any:
    answer = client.post(f"/api/v1/alarms/{path}", json={} if body is None else body)
    assert answer.status_code == status, answer.text
    if status != 200:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["status"] == status
    return answer.json()


def get(client: TestClient, path: str) -> Any:
    answer = client.get(f"/api/v1/alarms{path}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def pages(client: TestClient, limit: int, filters: str = "") -> list[list[Any]]:
    """The alarms of all pages."""
    body = get(client, f"?limit={limit}{filters}")
    found = [body["alarms"]]
    while body["next"] is not None:
        body = get(client, f"?limit={limit}&cursor={body['next']}{filters}")
        found.append(body["alarms"])
    return found


def test_pages_hold_each_alarm_once_though_others_are_raised_meanwhile(
    stage: Stage, client: TestClient, fm_alarm: Alarm
) -> None:
    """Two of them were raised at the same time."""
    times = [fm_alarm.raised_us + (k // 2) * 1_000_000 for k in range(7)]
    numbers = [stage.record(f"demo.axis{k}", "1", 0.06, replace(fm_alarm, raised_us=t)) for k, t in enumerate(times)]
    for limit in (1, 2, 3, 7, 8):
        assert [a["id"] for page in pages(client, limit) for a in page] == numbers[::-1]
    first = get(client, "?limit=3")
    stage.record("demo.axis9", "1", 0.06, replace(fm_alarm, raised_us=NOON_US))
    second = get(client, f"?limit=9&cursor={first['next']}")
    assert [a["id"] for a in (*first["alarms"], *second["alarms"])] == numbers[::-1]
    assert (second["total"], second["next"]) == (8, None)


def test_a_cursor_that_is_none_is_refused(client: TestClient) -> None:
    for cursor in ("", "x", "-5", "1.", ".1", "1.-2", "1.2.3", "1" * 40):
        answer = client.get(f"/api/v1/alarms?cursor={cursor}")
        assert (answer.status_code, answer.json()["status"]) == (400, 400)


def test_an_alarm_is_acknowledged_shelved_and_comes_back_by_itself(
    stage: Stage, client: TestClient, number: int
) -> None:
    seen = post(client, f"{number}/acknowledge", {"comment": "I look at it"})
    assert (seen["state"], seen["active"]) == ("acknowledged", True)
    body = {"until": "2026-03-01T15:00:00+01:00", "comment": "part is ordered", "work_order": "WO-17"}
    shelved = post(client, f"{number}/shelve", body)
    assert (shelved["state"], shelved["returns_to"]) == ("shelved", "acknowledged")
    assert (shelved["shelved_until"], shelved["work_order"]) == ("2026-03-01T14:00:00.000000Z", "WO-17")
    assert [a["id"] for a in get(client, "?state=shelved")["alarms"]] == [number]
    stage.now_us = NOON_US + 2 * HOUR_US
    (back,) = get(client, "?active=true")["alarms"]
    assert (back["state"], back["returns_to"], back["shelved_until"]) == ("acknowledged", None, None)
    stage.journal.end_shelves(stage.now_us)
    events = [(t["event"], t["who"], t["comment"]) for t in get(client, f"/{number}")["transitions"]]
    assert events == [
        ("raise", "axiswatch", None),
        ("acknowledge", "local", "I look at it"),
        ("shelve", "local", "part is ordered"),
        ("shelf ended", "axiswatch", None),
    ]
    again = post(client, f"{number}/shelve", {"duration_s": 3600})
    assert again["shelved_until"] == "2026-03-01T15:00:00.000000Z"
    assert post(client, f"{number}/unshelve")["state"] == "acknowledged"
    assert post(client, f"{number}/comment", {"work_order": "WO-18"})["work_order"] == "WO-18"


def test_what_is_not_possible_is_a_problem_with_its_reason(client: TestClient, number: int) -> None:
    post(client, f"{number}/acknowledge")
    twice = post(client, f"{number}/acknowledge", status=409)
    assert twice["title"] == "Conflict"
    assert twice["detail"].startswith("not possible: acknowledge; the alarm is acknowledged: ")
    assert "the alarm is acknowledged" in post(client, f"{number}/unshelve", status=409)["detail"]
    unknown = post(client, "77/acknowledge", status=404)
    assert (unknown["detail"], unknown["known"]) == ("no alarm 77", [str(number)])
    past: list[dict[str, Any]] = [{"duration_s": 0}, {"until": "2026-03-01T12:00:00Z"}]
    far: list[dict[str, Any]] = [{"duration_s": 7 * 86400 + 1}, {"duration_s": 1e300}]
    for shelf in past:
        assert "in the future" in post(client, f"{number}/shelve", shelf, status=400)["detail"]
    for shelf in (*far, {"until": "9999-12-31T00:00:00Z"}):
        assert "at most 7 days" in post(client, f"{number}/shelve", shelf, status=400)["detail"]
    assert len(get(client, f"/{number}")["transitions"]) == 2


def test_bodies_that_are_not_as_described_are_refused(client: TestClient, number: int) -> None:
    bodies: tuple[tuple[str, dict[str, Any]], ...] = (
        ("shelve", {}),
        ("shelve", {"duration_s": 60, "until": "2026-03-01T13:00:00Z"}),
        ("shelve", {"until": "2026-03-01T13:00:00"}),
        ("comment", {"comment": "x" * 2001}),
        ("shelve", {"until": 1_772_366_400}),
        ("acknowledge", {"who": "somebody else"}),
        ("acknowledge", {"comment": "\x1b[2J"}),
    )
    for action, body in bodies:
        post(client, f"{number}/{action}", body, status=422)
    post(client, f"{number}/comment", {"comment": "two\nlines\t\u00b5"})
    address = f"/api/v1/alarms/{number}/comment"
    answer = client.post(address, content=b"~\x11D\xff\x1c", headers={"content-type": "application/json"})
    assert (answer.status_code, answer.headers["content-type"]) == (400, "application/problem+json")
    schema = client.get("/openapi.json").json()
    assert "HTTPValidationError" not in json.dumps(schema)
    paths = schema["paths"]
    taking = [operation for path in paths.values() for operation in path.values() if "requestBody" in operation]
    assert taking
    assert all("400" in operation["responses"] for operation in taking)


@pytest.mark.parametrize(
    ("action", "body", "status", "detail"),
    [
        ("shelve", '{"duration_s": NaN}', 422, "duration_s: Input should be a finite number"),
        ("shelve", '{"duration_s": 1e999}', 422, "duration_s: Input should be a finite number"),
        ("shelve", '{"duration_s": 1e308}', 400, "an alarm can be shelved for at most 7 days"),
        ("shelve", '{"duration_s": -1e308}', 400, "an alarm can be shelved only until a time in the future"),
        ("comment", '{"comment": NaN}', 422, "comment: Input should be a valid string"),
        ("comment", r'{"comment": "\ud800"}', 422, "comment: Input should be a valid string"),
        ("comment", r'{"comment": "\u001b"}', 422, "comment: must be a text without control characters"),
        ("comment", r'{"comment": ["\ud800"]}', 422, "comment: Input should be a valid string"),
        ("comment", '{"comment": "a', 422, "the body is no JSON: Unterminated string starting at, at char"),
        ("comment", '{"comment": ""}', 422, "body: give comment, work_order or both"),
    ],
)
def test_values_that_no_json_can_hold_are_refused_in_words(
    client: TestClient, number: int, action: str, body: str, status: int, detail: str
) -> None:
    answer = client.post(
        f"/api/v1/alarms/{number}/{action}", content=body, headers={"content-type": "application/json"}
    )
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert answer.json()["detail"].startswith(detail)


def test_a_range_that_ends_before_it_begins_is_refused(client: TestClient) -> None:
    for path in ("", "/statistics"):
        query = "since=2026-03-01T12:00:00Z&until=2026-03-01T11:00:00Z"
        assert client.get(f"/api/v1/alarms{path}?{query}").status_code == 400


def test_times_at_the_ends_of_the_calendar_are_times(client: TestClient) -> None:
    first, last = "0001-01-01T00:00:00%2B23:59", "9999-12-31T23:59:59-23:59"
    for query in (f"until={first}", f"since={first}", f"since={last}", f"since={first}&until={last}"):
        assert client.get(f"/api/v1/alarms/statistics?{query}").status_code in (200, 400), query
        assert client.get(f"/api/v1/alarms?{query}").status_code == 200, query


def test_a_form_of_another_site_changes_nothing(client: TestClient, number: int) -> None:
    """A browser sends such bodies to any site without asking it."""
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        answer = client.post(f"/api/v1/alarms/{number}/acknowledge", content=b"{}", headers={"content-type": kind})
        assert answer.status_code == 422
    assert get(client, f"/{number}")["state"] == "unacknowledged"


def test_an_alarm_that_the_disk_refuses_is_first_in_the_list_and_makes_not_ready(
    stage: Stage, client: TestClient, number: int, fm_alarm: Alarm
) -> None:
    entries = [
        AlarmEntry("demo.axis2", "1", 1.0, replace(fm_alarm, past=(), parameter=p), AlarmRules("high"))
        for p in ("kT", "Ja")
    ]
    stage.healthy()
    assert client.get("/readyz").status_code == 200
    unrecorded = tuple(as_recorded(entry, recorded=False) for entry in entries)
    waiting = AlarmsSnapshot(unrecorded=unrecorded, waiting=2)
    stage.snapshot = replace(stage.snapshot, alarms=waiting)
    ready = client.get("/readyz")
    assert (ready.status_code, ready.json()["reasons"]) == (
        503,
        ["alarms that are not yet recorded: 2; the messages say why"],
    )
    body = get(client, "?active=true")
    assert body["total"] == 3
    found = [(a["id"], a["recorded"], a["parameter"], a["priority"]) for a in body["alarms"]]
    assert found == [(None, False, "Ja", "high"), (None, False, "kT", "high"), (number, True, "fm", "medium")]
    for limit, expected in {
        1: [["Ja"], ["kT"], ["fm"]],
        2: [["Ja", "kT"], ["fm"]],
        3: [["Ja", "kT", "fm"]],
    }.items():
        assert [[a["parameter"] for a in page] for page in pages(client, limit)] == expected
    assert [len(page) for page in pages(client, 1, "&axis=demo.axis2")] == [1, 1]
    for query, total in {
        "axis=demo.axis1": 1, "parameter=kT": 1, "state=unacknowledged": 3, "state=shelved": 0, "active=false": 0,
        "state=stale": 0, "state=chattering": 0, "since=2026-03-01T12:00:00Z": 0, "until=2026-03-01T12:00:00Z": 3,
    }.items():  # fmt: skip
        assert get(client, f"?{query}")["total"] == total, query


def test_an_alarm_that_the_disk_refuses_can_be_acknowledged_and_nothing_else(
    stage: Stage, client: TestClient, number: int, fm_alarm: Alarm
) -> None:
    entry = AlarmEntry("demo.axis2", "1", 1.0, fm_alarm)
    waiting, notes = as_recorded(entry, number + 1, recorded=False), dict[int, Note]()
    stage.snapshot = replace(stage.snapshot, alarms=AlarmsSnapshot(unrecorded=(waiting,), waiting=1))

    def acknowledge(alarm_id: int, note: Note) -> RecordedAlarm | None:
        notes[alarm_id] = note
        known = alarm_id == waiting.id
        return as_recorded(entry._replace(acknowledged=note), alarm_id, recorded=False) if known else None

    stage.acknowledge = acknowledge
    shown = get(client, f"/{waiting.id}")
    assert (shown["id"], shown["recorded"], shown["transitions"]) == (waiting.id, False, [])
    found = post(client, f"{waiting.id}/acknowledge", {"comment": "heard it", "work_order": "WO-1"})
    assert (found["state"], found["recorded"], found["work_order"]) == ("acknowledged", False, "WO-1")
    assert notes[waiting.id] == Note(stage.now_us, "local", "heard it", "WO-1")
    refused: dict[str, dict[str, Any]] = {
        "comment": {"comment": "a"},
        "shelve": {"duration_s": 60},
        "unshelve": {},
    }
    for path, body in refused.items():
        assert "not yet recorded" in post(client, f"{waiting.id}/{path}", body, status=503)["detail"]
    post(client, f"{waiting.id + 1}/acknowledge", status=404)
    stage.journal.close()  # a file that can be neither read nor written
    assert post(client, f"{waiting.id}/acknowledge")["state"] == "acknowledged"
    post(client, f"{number}/acknowledge", status=503)


def test_statistics_are_of_the_last_seven_days_unless_told_otherwise(
    stage: Stage, client: TestClient, number: int
) -> None:
    body = get(client, "/statistics")
    assert (body["since"], body["until"]) == ("2026-02-22T12:00:00.250000Z", "2026-03-01T12:00:00.250000Z")
    assert (body["raised"], body["announced"], body["most_in_ten_minutes"]) == (1, 1, 1)
    name = {"axis": "demo.axis1", "parameter": "fm", "direction": "up", "alarms": 1}
    assert body["most_frequent"] == [name]
    assert body["states"] == [{"state": "unacknowledged", "priority": "medium", "alarms": 1}]
    assert get(client, "/statistics?until=2026-03-01T11:00:00Z")["raised"] == 0
    stage.journal.close()
    assert client.get("/api/v1/alarms/statistics").status_code == 503
    assert "cannot be read or written" in post(client, f"{number}/acknowledge", status=503)["detail"]


def test_an_axis_is_taken_out_of_service_and_returned(stage: Stage, client: TestClient, number: int) -> None:
    def service(action: str, body: dict[str, Any], status: int = 200) -> Any:
        answer = client.post(f"/api/v1/axes/demo.axis1/{action}", json=body)
        assert answer.status_code == status, answer.text
        return answer.json()

    noon = "2026-03-01T12:00:00.250000Z"
    out = {"since": noon, "who": "local", "comment": "new gearbox", "work_order": "WO-9"}
    assert client.get("/api/v1/axes/demo.axis1/service").json()["out_of_service"] is None
    found = service("out-of-service", {"comment": "new gearbox", "work_order": "WO-9"})
    assert found["out_of_service"] == out
    assert get(client, f"/{number}")["state"] == "out-of-service"
    assert "out of service already" in service("out-of-service", {}, 409)["detail"]
    with_axis(stage, out_of_service=stage.journal.services.removed()["demo.axis1"])
    assert client.get("/api/v1/axes/demo.axis1").json()["out_of_service"] == out
    assert state_body(stage.snapshot.axes[0], NOON_US).model_dump()["out_of_service"] == out
    found = service("return-to-service", {"comment": "done"})
    assert (found["out_of_service"], [s["event"] for s in found["steps"]]) == (
        None,
        ["remove from service", "return to service"],
    )
    assert get(client, f"/{number}")["state"] == "unacknowledged"
    assert "no person has taken demo.axis1" in service("return-to-service", {}, 409)["detail"]
    assert client.post("/api/v1/axes/demo.axis9/out-of-service", json={}).status_code == 404


def test_an_axis_that_the_configuration_has_taken_out_of_service_says_so(stage: Stage, client: TestClient) -> None:
    with_axis(stage, out_of_service=Note(0, CONFIGURATION))
    out = {"since": None, "who": "configuration", "comment": None, "work_order": None}
    for address in ("demo.axis1", "demo.axis1/service"):
        assert client.get(f"/api/v1/axes/{address}").json()["out_of_service"] == out
