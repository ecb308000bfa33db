"""The server, the files of its pages and how they are built, and openapi.json, which every answer matches."""

import gzip
import json
import re
import socket
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient

from hatch_build import is_current, npm
from monitor_core.detection import Alarm
from service.web.app import STATIC
from service.web.server import CannotListenError, listen, serve
from tests.end_to_end.processes import PATIENCE_S
from tests.ports import own_port
from tests.service.web.api_schema import matches_schema
from tests.service.web.conftest import Daemon, Stage, robot_setup
from tests.service.web.watched_drives import reference, watch


def test_it_serves_until_it_is_stopped(stage: Stage) -> None:
    daemon = Daemon(stage, own_port())
    with httpx.Client(base_url=daemon.url, timeout=PATIENCE_S) as client:
        assert client.get("/healthz").status_code == 200
        daemon.stop()
        with pytest.raises(httpx.ConnectError):
            client.get("/healthz")
    # The same port can be had again at once.
    listen("127.0.0.1", daemon.port).close()


def test_it_runs_in_the_main_thread_and_leaves_signals_alone(stage: Stage) -> None:
    stop = threading.Event()
    ports: list[int] = []

    def ready(port: int) -> None:
        ports.append(port)
        stop.set()

    serve(stage.app(), "localhost", 0, ready, stop)
    assert len(ports) == 1


def test_a_taken_port_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(CannotListenError, match=rf"127\.0\.0\.1 port {port}: the port is taken"):
            listen("127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "why"),
    [
        ("192.0.2.1", "this machine has no such address"),
        ("no such host", "no such host"),
        ("a" * 70, "no such"),
    ],
)
def test_an_address_that_is_not_ours_is_said(host: str, why: str) -> None:
    with pytest.raises(CannotListenError, match=why):
        listen(host, 0)


def test_ipv6_where_there_is_any() -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError as error:
        pytest.skip(f"this machine has no IPv6: {error}")
    with listen("::1", 0) as listener:
        assert listener.family == socket.AF_INET6


# --- static files -------------------------------------------------------------------------------------------


ICONS = [f"/static/icon-{number}.svg" for number in (*range(1, 10), "9+")]
FILES = ["/", "/docs", *(f"/static/{path.name}" for path in sorted(STATIC.glob("*"))), *ICONS]


def test_pages_forbid_what_they_do_not_need(client: TestClient) -> None:
    for path in FILES:
        answer = client.get(path)
        assert answer.status_code == 200, path
        assert "default-src 'none'" in answer.headers["content-security-policy"], path
        assert answer.headers["x-content-type-options"] == "nosniff", path
        hosts = set(re.findall(r"(\w+://[^/\s\"'`]+)", answer.text))
        assert hosts <= {"http://www.w3.org"}, path  # names of the languages of the page, which nobody asks


def test_the_icon_has_the_number_of_alarms(client: TestClient) -> None:
    for path, words in zip(ICONS, [*"123456789", "9+"], strict=True):
        answer = client.get(path)
        assert answer.headers["content-type"] == "image/svg+xml"
        assert f'text-anchor="middle">{words}</text></svg>' in answer.text
    assert client.get("/static/icon-10.svg").status_code == 422


def test_no_file_outside_is_served(client: TestClient) -> None:
    assert client.get("/static/../app.py").status_code == 404
    assert client.get("/static/%2e%2e/app.py").status_code == 404
    assert Path(STATIC / ".." / "app.py").exists()


# --- the dashboard as built ------------------------------------------------------------------------------------------


def test_the_dashboard_is_small() -> None:
    """All of it, as a server that compresses would send it."""
    assert (STATIC / "index.html").is_file(), "not built: python hatch_build.py"
    assert sum(len(gzip.compress(file.read_bytes())) for file in STATIC.iterdir()) <= 80_000


def test_the_dashboard_is_newer_than_its_sources() -> None:
    """Else the tests of the page would test another one; `make` builds it by itself."""
    assert is_current(), "python hatch_build.py"


def test_the_lock_file_of_the_dashboard_has_hashes_and_no_host() -> None:
    packages = json.loads((STATIC.with_name("dashboard") / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert [name for name, p in packages.items() if name and "integrity" not in p] == []
    assert [name for name, p in packages.items() if "resolved" in p] == []


def test_the_data_layer_of_the_dashboard() -> None:
    npm("test", "--silent")  # with what npm writes, if one fails


# --- openapi.json -------------------------------------------------------------------------------------------


ACTIONS = {
    "acknowledge": {"comment": "seen"},
    "shelve": {"duration_s": 60},
    "unshelve": {},
    "comment": {"work_order": "WO-17"},
}


@pytest.fixture
def schema(client: TestClient) -> dict[str, Any]:
    found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def test_each_address_answers_as_described(
    stage: Stage, client: TestClient, schema: dict[str, Any], fm_alarm: Alarm
) -> None:
    """Names, kinds, ranges and formats of all values; with every field, and no other."""
    stage.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, ended_us=fm_alarm.updated_us))
    stage.record("demo.axis1", "N m s/rad", 0.06, replace(fm_alarm, raised_us=0))
    stage.setup = robot_setup()
    as_it_is, watched, asked = stage.snapshot, replace(stage), 0
    watch(watched, reference())
    for path, methods in schema["paths"].items():
        described = methods.get("get", {"responses": {"200": {}}})
        if "application/json" not in described["responses"]["200"].get("content", {}):
            continue
        stage.snapshot = watched.snapshot if path.endswith(("/model", "/bode")) else as_it_is
        answer = client.get(path.replace("{axis}", "demo.axis1").replace("{id}", "1"))
        assert answer.status_code == (503 if path == "/readyz" else 200), path
        matches_schema(answer, described, schema)
        asked += 1
    assert asked > 20


def test_each_action_answers_as_described_also_when_it_is_not_possible(
    stage: Stage, client: TestClient, schema: dict[str, Any], fm_alarm: Alarm
) -> None:
    stage.record("demo.axis1", "N m s/rad", 0.06, fm_alarm)
    statuses = []
    for action, request in (*ACTIONS.items(), *ACTIONS.items()):
        for number in (1, 7):
            answer = client.post(f"/api/v1/alarms/{number}/{action}", json=request)
            matches_schema(answer, schema["paths"][f"/api/v1/alarms/{{id}}/{action}"]["post"], schema)
            statuses.append(answer.status_code)
    assert statuses == [200, 404] * 4 + [409, 404] + [200, 404] * 3
    past = client.post("/api/v1/alarms/1/shelve", json={"duration_s": -1})
    matches_schema(past, schema["paths"]["/api/v1/alarms/{id}/shelve"]["post"], schema)
    assert past.status_code == 400


def test_all_is_explained(schema: dict[str, Any]) -> None:
    """Numbers tell their unit or what they count."""
    silent = [
        f"{name}.{field}"
        for name, body in schema["components"]["schemas"].items()
        for field, described in body.get("properties", {}).items()
        if "number" in str(described.get("type", described.get("anyOf"))) and "description" not in described
    ]
    assert silent == []
    for path, methods in schema["paths"].items():
        for described in methods.values():
            assert described["summary"], path
            assert described["description"], path
