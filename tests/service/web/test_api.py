"""REST: what the snapshot and the journal hold, and nothing that JSON cannot."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from monitor_core.detection import Alarm, Reach
from monitor_core.wording import sentence
from service.pipeline.snapshot import Snapshot
from service.store.alarm_transitions import Note
from service.texts.instants import iso
from service.web import models, views
from service.web.app_state import CachedAnswer
from tests.service.web.conftest import COUNTERS, Stage, slow_courses, with_axis


def get(client: TestClient, path: str, status: int = 200) -> Any:
    answer = client.get(path)
    assert answer.status_code == status, answer.text
    return json.loads(answer.text, parse_constant=_no_constant)


def _no_constant(name: str) -> None:
    raise AssertionError(f"{name} is not JSON")


def test_axes_tell_all_of_every_axis(client: TestClient) -> None:
    body = get(client, "/api/v1/axes")
    assert body["taken"] == "2026-03-01T12:00:00.000000Z"
    first, second = body["axes"]
    assert get(client, "/api/v1/axes/demo.axis1") == first
    expected = {
        "id": "demo.axis1",
        "last_sample": "2026-03-01T11:59:59.600000Z",
        "last_sample_age_s": 0.65,
        "samples": 127_530,
        "counters": COUNTERS,
        "gated_by": None,
        "confounded": ["1/Ja is not observed"],
        "dropped": {"no_partner": 5, "late": 0},
        "clock": {"clock_reanchored": 3},
        "stamps": {"clock": "cyclic", "scatter_s": 0.00041, "interval_s": 0.0050002},
        "innovation_unit": "rad",
        "open_alarms": ["fm"],
    }
    assert {name: first[name] for name in expected} == expected
    assert first["detectors"] == [
        {"name": "cusum", "alarms": True, "leading": "fm", "evidence": 0.725},
        {"name": "multimodel", "alarms": False, "leading": "torque sign", "evidence": 1.5},
    ]
    assert (first["model"]["drive"], first["model"]["output"]) == ("three-mass", "angle")
    assert {"name": "Ja", "value": 95.717, "unit": "kg m^2"} in first["model"]["nominal"]
    assert (second["id"], second["last_sample"], second["last_sample_age_s"]) == ("demo.axis2", None, None)
    assert second["stamps"] == {"clock": "receipt", "scatter_s": None, "interval_s": None}
    assert second["detectors"][0]["leading"] is None


def test_axes_are_written_as_their_model_is_and_what_is_not_finite_as_null(client: TestClient, stage: Stage) -> None:
    first, second = stage.snapshot.axes
    kT, *others = first.status.parameters
    kT = replace(kT, estimate=math.nan, g_up=math.inf, g_down=-math.inf)
    status = replace(first.status, parameters=(kT, *others), innovation_variance=math.nan)
    away = replace(second, out_of_service=Note(stage.now_us, "anna", "new gearbox"), gated_by="mode = 2", heat=None)
    stage.snapshot = replace(stage.snapshot, axes=(replace(first, status=status), away))
    axes = [views.axis(a, stage.now_us) for a in stage.snapshot.axes]
    broken = axes[0].parameters[0]
    assert (broken.estimate, broken.cusum.up, broken.cusum.down, axes[0].innovation_variance) == (None,) * 4
    expected = models.Axes(taken=iso(stage.snapshot.taken_us), axes=axes)
    assert client.get("/api/v1/axes").text == expected.model_dump_json()


def test_all_axes_are_written_once_in_two_seconds_and_for_each_snapshot(client: TestClient, stage: Stage) -> None:
    """While the worker hangs, too, the ages grow."""

    def age() -> float:
        return float(get(client, "/api/v1/axes")["axes"][0]["last_sample_age_s"])

    assert age() == 0.65
    stage.now_us += 1_900_000
    assert age() == 0.65
    stage.now_us += 200_000
    assert age() == 2.75
    stage.now_us += 100_000
    stage.snapshot = replace(stage.snapshot, messages=())
    assert age() == 2.85
    stage.now_us -= 500_000  # the clock was set
    assert age() == 2.35


def test_what_somebody_asks_for_is_made_with_each_snapshot(stage: Stage) -> None:
    made, old = list[int](), stage.snapshot

    def make(_snapshot: Snapshot, now_us: int) -> bytes:
        made.append(now_us)
        if len(made) == 2:
            raise ValueError
        return b""

    def later(seconds: int) -> Snapshot:
        return replace(old, taken_us=old.taken_us + seconds * 1_000_000)

    latest, new = CachedAnswer(make, 2.0), later(2)
    assert latest.made(old) is None
    assert made == []  # nobody has asked
    latest(old, old.taken_us)
    latest.hold(latest.made(later(1)))  # it fails, which the worker does not notice
    latest.hold(latest.made(new))
    latest(new, new.taken_us + 500_000)
    assert latest.made(later(63)) is None
    assert made == [later(t).taken_us for t in range(3)]


def test_what_forbids_to_learn_is_told(client: TestClient, stage: Stage) -> None:
    with_axis(stage, gated_by="mode = 2")
    assert [axis["gated_by"] for axis in get(client, "/api/v1/axes")["axes"]] == ["mode = 2", None]
    metrics = client.get("/metrics").text
    assert 'axiswatch_axis_gated{axis="demo.axis1"} 1.0' in metrics
    assert 'axiswatch_axis_gated{axis="demo.axis2"} 0.0' in metrics


def test_a_parameter_has_its_unit_and_both_cusums(client: TestClient) -> None:
    parameters = get(client, "/api/v1/axes/demo.axis1")["parameters"]
    assert parameters[2] == {
        "name": "fm", "unit": "N m s/rad", "meaning": "viscous friction of the motor",
        "nominal": 0.06, "estimate": 0.07832, "standard_deviation": 0.00256, "p_diagonal": 1.31e-5,
        "cusum": {"up": 0.87, "down": 0.0}, "threshold": 1.2, "tolerance": 0.01087,
        "status": "alarm", "observation": "weakly observed",
        "tested": True, "not_tested_reason": None, "tested_s": 594.0,
    }  # fmt: skip


def test_what_is_not_tested_says_why_and_what_would_help(client: TestClient) -> None:
    first, second = get(client, "/api/v1/axes")["axes"]
    shown = [(p["tested"], p["not_tested_reason"], p["tested_s"]) for p in first["parameters"]]
    assert shown == [(True, None, 594.0), (False, "not observed", 421.5), (True, None, 594.0)]
    (words,) = first["not_tested"]
    assert words.startswith("1/Ja is not tested: the motion contains almost no information (1/Ja is not observed)")
    assert {p["not_tested_reason"] for p in second["parameters"]} == {"no sample"}
    (words,) = second["not_tested"]
    assert words.startswith("kT, 1/Ja and fm are not tested: no sample is received. Needed: ")


def test_the_slow_course_tells_the_drift_and_when_the_limit_is_reached(client: TestClient) -> None:
    trend = client.get("/api/v1/axes/demo.axis1/trend?points=50").json()
    assert (trend["axis"], trend["interval_s"], trend["lost"]) == ("demo.axis1", 3600.0, 0)
    kT, _, fm = trend["parameters"]
    assert (kT["drift"], kT["limits"], kT["time"]) == (None, [], [])
    assert kT["words"] == "kT: too little data yet to detect a drift"
    assert fm["words"] == "fm drifts up by 0.0024 N m s/rad ± 0.00013 per day"
    assert (fm["drift"]["drift"], fm["drift"]["slope_per_day"]) == (0.97, pytest.approx(2.75e-8 * 86400))
    drift = slow_courses()[2].trend
    assert drift is not None
    assert fm["drift"]["change"] == pytest.approx(drift.change)
    assert fm["drift"]["changed"] == iso(drift.change_us)
    (limit,) = fm["limits"]
    assert limit["words"] == "fm reaches 0.09 N m s/rad in 12 to 20 days"
    assert (limit["low"], limit["high"]) == ("2026-03-13T12:00:00.000000Z", "2026-03-21T12:00:00.000000Z")
    assert len(fm["time"]) == len(fm["mean"]) == len(fm["standard_deviation"]) == len(fm["operating_s"]) == 50
    assert fm["standard_deviation"][-1] == pytest.approx(1e-4)  # of four hours, each 2e-4
    assert sum(fm["operating_s"]) == pytest.approx(200 * 3600)
    found = client.get("/api/v1/axes/demo.axis1/trend?parameter=fm").json()
    assert [p["name"] for p in found["parameters"]] == ["fm"]
    assert len(found["parameters"][0]["time"]) == 200
    assert client.get("/api/v1/axes/demo.axis1/trend?parameter=fx").status_code == 404
    assert client.get("/api/v1/axes/demo.axis2/trend").json()["lost"] == 1


def test_an_alarm_about_a_limit_has_it(stage: Stage, client: TestClient, fm_alarm: Alarm) -> None:
    limit = Reach("fm", "N m s/rad", 0.09, True, "open", fm_alarm.updated_us + 86_400_000_000, None)
    stage.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, kind="forecast", reaches=(limit,)))
    (alarm,) = client.get("/api/v1/alarms").json()["alarms"]
    assert alarm["kind"] == "forecast"
    assert alarm["words"].startswith("fm reaches 0.09 N m s/rad in 24 hours or later, perhaps never; now fm is ")
    assert [(r["state"], r["high"]) for r in alarm["reaches"]] == [("open", None)]


def test_what_is_not_there_is_answered_with_what_is(client: TestClient) -> None:
    for path, known, word in (
        ("axes/demo.axis9", ["demo.axis1", "demo.axis2"], "demo.axis9"),
        ("axes/demo.axis9/history", ["demo.axis1", "demo.axis2"], "demo.axis9"),
        ("axes/demo.axis1/history?parameter=kg", ["kT", "1/Ja", "fm"], "'kg'"),
        ("alarms/7", [], "alarm 7"),
    ):
        body = get(client, f"/api/v1/{path}", status=404)
        assert body["known"] == known
        assert word in body["detail"]
    body = get(client, "/api/v2/axes", status=404)
    assert "/api/v2/axes" in body["detail"]
    assert {"/api/v1/axes", "/metrics", "/docs"} <= set(body["known"])


def test_bad_filters_are_refused(client: TestClient) -> None:
    for query in (
        "since=yesterday",
        "since=2026-03-01T12:00:00",
        "until=0.5",
        "until=1772366400",
        "since=20260301T120000Z",
        "since=2026-03-01",
        "since=2026-03-01T12:00:00%2B99:00",
        "since=2026-13-01T12:00:00Z",
        "limit=0",
        "limit=100000",
        "active=perhaps",
    ):
        body = get(client, f"/api/v1/alarms?{query}", status=422)
        assert body["detail"].startswith(query.split("=")[0] + ": ")


def test_alarms_are_told_with_their_times(stage: Stage, client: TestClient, fm_alarm: Alarm) -> None:
    number = stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    body = get(client, "/api/v1/alarms")
    assert (body["total"], body["limit"], body["next"]) == (1, 100, None)
    before = {
        "until": "2026-03-01T11:59:56.000000Z",
        "stage": "changed",
        "parameter": "kT",
        "direction": "up",
    }
    assert body["alarms"] == [
        {
            "id": number, "recorded": True, "recording": None,
            "state": "unacknowledged", "returns_to": None, "shelved_until": None,
            "priority": "medium", "work_order": None, "first_out": False, "follows": None, "same_payload": [],
                "axis": "demo.axis1", "parameter": "fm",
            "direction": "up", "stage": "named",
            "causes": [
                {"parameter": "fm", "probability": 0.97, "alike": []},
                {"parameter": "kT", "probability": 0.03, "alike": []},
            ],
            "doubt": "", "inside_calibration": None, "kind": "step", "reaches": [], "active": True,
            "words": "fm is 0.018 N m s/rad (31 %, 25 to 36) above its nominal value",
            "unit": "N m s/rad", "nominal": 0.06, "size": 0.01832, "size_sd": 0.0021, "crossings": 4,
            "onset": "2026-03-01T11:59:51.000000Z", "onset_low": "2026-03-01T11:59:50.400000Z",
            "onset_high": "2026-03-01T11:59:51.200000Z", "raised": "2026-03-01T11:59:53.000000Z",
            "updated": "2026-03-01T11:59:59.500000Z", "ended": None, "reopened": None, "past": [before],
        }
    ]  # fmt: skip
    raised = {
        "at": "2026-03-01T11:59:53.000000Z", "event": "raise", "from_state": "normal", "until": None,
        "to_state": "unacknowledged", "who": "axiswatch", "comment": None, "work_order": None,
    }  # fmt: skip
    alone = get(client, f"/api/v1/alarms/{number}")
    assert alone == body["alarms"][0] | {"transitions": [raised], "report": None}


def test_a_journal_that_cannot_be_read_is_said(stage: Stage, client: TestClient) -> None:
    stage.journal.close()
    detail = get(client, "/api/v1/alarms", status=503)["detail"]
    assert detail == "a file of the daemon cannot be read or written: alarms.sqlite: it has been closed"
    assert get(client, "/api/v1/axes")["axes"]


def test_service_tells_why_it_is_not_ready(stage: Stage, client: TestClient) -> None:
    body = get(client, "/api/v1/service")
    assert body["ready"] is False
    assert body["reasons"] == ["bus can1: down: Network is down", "demo.axis2: no sample yet"]
    bus = {"lack": "bus", "name": "can1", "state": "down: Network is down", "since_s": None, "alarms": 0}
    axis = {"lack": "samples", "name": "demo.axis2", "state": "", "since_s": None, "alarms": 0}
    assert body["not_ready"] == [bus, axis]
    assert body["buses"][0]["dropped"] == {"queue_full": 12, "socket": 0}
    assert body["messages"] == [*stage.snapshot.messages, "link orders: HTTP status 503"]
    assert body["links"] == [
        {
            "name": "orders",
            "kind": "webhook",
            "connected": False,
            "problem": "HTTP status 503",
            "pending": 3,
            "delivered": 41,
            "given_up": {"age": 2, "refused": 1},
        }
    ]
    assert body["checkpoint"] == "2026-03-01T11:59:30.000000Z"
    stage.healthy()
    assert get(client, "/api/v1/service")["ready"] is True


def test_who_may_only_read_sees_no_folder_of_the_machine(stage: Stage, client: TestClient) -> None:
    """Of what the daemon cannot read or write; the log has the whole path."""
    why = sentence("file gone", "{path} is no longer there", path="/var/lib/axiswatch/history.sqlite")
    problem = sentence("history not written", "not written yet: {why}", why=why)
    stage.snapshot = replace(stage.snapshot, messages=(problem,))
    stage.links = (replace(stage.links[0], problem="/etc/axiswatch/ca/plant.pem: cannot read the certificate"),)
    stage.setup = replace(stage.setup, file=Path("/etc/axiswatch/robot.toml"))
    answer = client.get("/api/v1/service")
    assert "/var" not in answer.text
    assert "/etc" not in answer.text
    body = answer.json()
    assert body["messages"] == [
        "not written yet: history.sqlite is no longer there",
        "link orders: ca/plant.pem: cannot read the certificate",
    ]
    translated = {found["words"]: found["kind"] for found in body["sentences"]}
    assert translated[body["messages"][0]] == "history not written"


def test_alive_while_the_worker_reports(stage: Stage, client: TestClient) -> None:
    assert get(client, "/healthz") == {"alive": True, "snapshot_age_s": 0.25, "insecure": False}
    stage.now_us = stage.snapshot.taken_us + 10_500_000
    body = get(client, "/healthz", status=503)
    assert (body["alive"], body["snapshot_age_s"]) == (False, 10.5)


def test_ready_while_all_axes_get_samples(stage: Stage, client: TestClient) -> None:
    assert get(client, "/readyz", status=503)["reasons"] == [
        "bus can1: down: Network is down",
        "demo.axis2: no sample yet",
    ]
    stage.healthy()
    assert get(client, "/readyz") == {"ready": True, "reasons": []}
    stage.now_us += 7_000_000
    silent = get(client, "/readyz", status=503)["reasons"]
    assert silent == ["demo.axis1: no sample for 8 s", "demo.axis2: no sample for 8 s"]
    slow = replace(stage.snapshot.axes[1], interval_s=0.8)
    stage.snapshot = replace(stage.snapshot, axes=(stage.snapshot.axes[0], slow))
    assert get(client, "/readyz", status=503)["reasons"] == ["demo.axis1: no sample for 8 s"]
    stage.now_us += 7_000_000
    assert "the worker has not reported for 14 s" in get(client, "/readyz", status=503)["reasons"]
