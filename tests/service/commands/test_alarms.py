"""`axiswatch alarms` and `axiswatch status` against a daemon that stands still, over a real socket."""

import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from monitor_core.detection import Alarm
from monitor_core.monitoring import AlarmRules
from service.client import Client, ClientError, Remark
from service.pipeline.persistence.alarm_recording import AlarmsSnapshot, as_recorded
from service.store.alarm_entries import AlarmEntry
from service.store.journal import Journal
from tests import golden
from tests.end_to_end.processes import PATIENCE_S
from tests.service.command_line import as_json, refused, session, shown
from tests.service.web.conftest import FM_ALARM, NOON_US, Stage, serving

GOLDEN = Path(__file__).parent / "golden"
TLS = Path(__file__).parents[2] / "tls"
Answering = Callable[[bytes], tuple[str, list[bytes]]]
"""Starts a server with this answer; its address, and the requests that it gets"""


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    journal = Journal(tmp_path / "alarms.sqlite")
    yield Stage(journal)
    journal.close()


@pytest.fixture
def url(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    with capture_logs(), serving(stage) as address:  # standard output is that of the commands
        monkeypatch.setenv("AXISWATCH_URL", address)
        yield address


def recorded(stage: Stage, alarm: Alarm = FM_ALARM) -> int:
    return stage.record("demo.axis1", "N m s/rad", 0.06, alarm)


@pytest.mark.usefixtures("url")
def test_one_alarm_from_the_list_to_the_work_order(stage: Stage) -> None:
    text = session("alarms", "list")
    recorded(stage)
    text += session(
        "alarms",
        "list",
        "ack 1 --comment 'I look'",
        "shelve 1 --for 2h --work-order WO-17",
        "list --state unacknowledged",
        "list --state shelved --axis demo.axis1",
        "unshelve 1",
        "shelve 1 --until 2026-03-01T13:00:00Z",
    )
    recorded(stage, replace(FM_ALARM, ended_us=NOON_US))
    text += session("alarms", "comment 1 --comment 'gearbox changed' --work-order WO-18", "show 1")
    golden.check(text, GOLDEN / "alarms_one.txt")


@pytest.mark.usefixtures("url")
def test_several_alarms_and_an_axis_out_of_service(stage: Stage) -> None:
    recorded(stage)
    stage.record("demo.axis2", "1", 0.06, replace(FM_ALARM, raised_us=FM_ALARM.raised_us + 1))
    text = session(
        "alarms",
        "list",
        "statistics",
        "statistics --until 2026-03-01T11:00:00Z",
        "out-of-service demo.axis1 --comment oil --work-order WO-9",
        "list --state out-of-service",
        "return-to-service demo.axis1",
    )
    golden.check(text, GOLDEN / "alarms_several.txt")


@pytest.mark.usefixtures("url")
def test_answers_as_json_are_those_of_the_api(stage: Stage) -> None:
    number = recorded(stage)
    assert as_json("alarms", "ack", number, "--json")["state"] == "acknowledged"
    assert [a["id"] for a in as_json("alarms", "list", "--json")["alarms"]] == [number]
    assert [t["event"] for t in as_json("alarms", "show", number, "--json")["transitions"]] == [
        "raise",
        "acknowledge",
    ]
    assert as_json("alarms", "statistics", "--json")["raised"] == 1
    assert len(as_json("alarms", "out-of-service", "demo.axis2", "--json")["steps"]) == 1
    stage.healthy()
    found = as_json("status", "--json")
    assert (found["ready"], found["active"], found["unacknowledged"]) == (True, 1, 0)


@pytest.mark.usefixtures("url")
def test_an_alarm_that_is_not_yet_recorded_is_in_the_list(stage: Stage) -> None:
    entry = AlarmEntry("demo.axis1", "N m s/rad", 0.06, FM_ALARM, AlarmRules("high"))
    for number, first in (0, "not yet recorded"), (7, "7 not yet recorded"):
        waiting = AlarmsSnapshot(unrecorded=(as_recorded(entry, number, recorded=False),), waiting=1)
        stage.snapshot = replace(stage.snapshot, alarms=waiting)
        words = f"{first}  demo.axis1 fm up: unacknowledged, high priority"
        assert shown("alarms", "list").startswith(words)


@pytest.mark.usefixtures("url")
def test_active_alarms_are_known_even_while_the_journal_cannot_be_read(stage: Stage, tmp_path: Path) -> None:
    recorded(stage)
    stage.healthy()
    standing = AlarmsSnapshot(standing=tuple(stage.journal.standing()))
    stage.snapshot = replace(stage.snapshot, messages=("the state of the monitors cannot be saved: why",))
    stage.snapshot = replace(stage.snapshot, alarms=standing)
    before = shown("status")
    (tmp_path / "alarms.sqlite").rename(tmp_path / "elsewhere")
    assert shown("status") == before
    assert "cannot be saved: why\nactive alarms: 1, unacknowledged: 1\n1  demo.axis1 fm up" in before
    assert shown("alarms", "list", "--state", "acknowledged") == "no alarm is acknowledged\n"
    for command in (["alarms", "list"], ["alarms", "list", "--state", "returned"], ["alarms", "show", "1"]):
        assert "alarms.sqlite is no longer there" in refused(*command, code=4)


def test_status_has_the_reasons_why_it_is_not_ready(stage: Stage, url: str) -> None:
    recorded(stage)
    lines = shown("status", code=4).splitlines()
    assert lines[0].endswith(f"at {url}: not ready")
    assert lines[1:3] == ["  bus can1: down: Network is down", "  demo.axis2: no sample yet"]
    assert lines[-3] == "active alarms: 1, unacknowledged: 1"
    assert lines[-2].startswith("1  demo.axis1 fm up: unacknowledged")
    stage.healthy()
    assert shown("status").splitlines()[0].endswith(f"at {url}: ready")


@pytest.mark.usefixtures("url")
def test_a_refusal_has_its_reason(stage: Stage) -> None:
    recorded(stage)
    text = session(
        "alarms",
        "unshelve 1",
        "show 77",
        "shelve 1 --for 8d",
        "shelve 1 --until 2026-03-01T11:00:00Z",
        "shelve 1 --until tomorrow",
        "shelve 1 --for soon",
        "shelve 1",
        "comment 1",
        "list --state loud",
        "return-to-service demo.axis1",
        "out-of-service demo.axis9",
        "list --axis demo.axis9",
        "statistics --since noon",
        "ack 0",
        "ack 1 1",
    )
    golden.check(text, GOLDEN / "alarms_mistakes.txt")


def test_a_daemon_that_does_not_answer_is_a_message_and_exit_code_4() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{free.getsockname()[1]}"
        for command in (("alarms", "list"), ("status",)):
            message = refused(*command, "--url", address, code=4)
            assert message.startswith(f"axiswatch: {address} does not answer (")
    assert "an address is http://HOST:PORT" in refused("status", "--url", "http://[::1", code=2)


def refused_by_certificate(name: str) -> str:
    """What a command says about a daemon with this certificate."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(TLS / name, TLS / "localhost.key")
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def run() -> None:
            with suppress(OSError), context.wrap_socket(listener.accept()[0], server_side=True):
                pass

        thread = threading.Thread(target=run)
        thread.start()
        message = refused("status", "--url", f"https://127.0.0.1:{listener.getsockname()[1]}", code=4)
        thread.join(PATIENCE_S)
    return message


def test_a_certificate_that_is_not_trusted_is_no_silence() -> None:
    message = refused_by_certificate("localhost.crt")
    assert "its certificate is not trusted here" in message
    assert "SSL_CERT_FILE" in message


def test_an_expired_certificate_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """To trust its authority would not help."""
    monkeypatch.setenv("SSL_CERT_FILE", str(TLS / "expired.crt"))
    message = refused_by_certificate("expired.crt")
    assert "its certificate has expired: put a new one in its place, and reload the daemon" in message
    assert "SSL_CERT_FILE" not in message


def test_a_token_that_no_header_can_hold_is_not_shown(url: str) -> None:
    for token in ("axw_secret\n axw", "axw_secret\u00e9"):
        message = refused("status", "--url", url, "--token", token, code=2)
        assert "this is no token" in message
        assert "secret" not in message
    assert "ready" in shown("status", "--token", " axw_of_a_file\n", code=4)


@pytest.fixture
def answering() -> Iterator[Answering]:
    """Servers that give one answer each."""
    listeners: list[tuple[socket.socket, threading.Thread]] = []

    def start(answer: bytes) -> tuple[str, list[bytes]]:
        listener = socket.create_server(("127.0.0.1", 0))
        requests: list[bytes] = []

        def run() -> None:
            connection, _ = listener.accept()
            with connection:
                requests.append(connection.recv(65536))
                connection.sendall(answer)

        thread = threading.Thread(target=run)
        thread.start()
        listeners.append((listener, thread))
        return f"http://127.0.0.1:{listener.getsockname()[1]}", requests

    yield start
    for listener, thread in listeners:
        thread.join(PATIENCE_S)
        listener.close()


def test_the_token_is_sent_and_another_server_is_named(answering: Answering, monkeypatch: pytest.MonkeyPatch) -> None:
    address, requests = answering(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\nconnection: close\r\n\r\nhi")
    monkeypatch.setenv("AXISWATCH_TOKEN", "secret-7")
    message = refused("status", "--url", address, code=4)
    assert message == f"axiswatch: {address} is no axiswatch: it answers 200 without JSON"
    assert b"authorization: bearer secret-7" in requests[0].lower()


def test_without_a_token_the_command_says_how_to_give_one(answering: Answering) -> None:
    body = b'{"detail": "this needs a token"}'
    head = b"HTTP/1.1 401 Unauthorized\r\ncontent-length: %d\r\nconnection: close\r\n\r\n" % len(body)
    address, _ = answering(head + body)
    message = refused("status", "--url", address)
    assert message == "axiswatch: this needs a token; give it by AXISWATCH_TOKEN or --token"


def test_a_refused_request_differs_from_a_daemon_in_trouble(stage: Stage, url: str) -> None:
    number = recorded(stage)
    with Client(url) as client:
        assert client.act(number, "acknowledge", Remark("seen"))["transitions"][-1]["comment"] == "seen"
        with pytest.raises(ClientError, match="the alarm is acknowledged") as conflict:
            client.act(number, "acknowledge", Remark())
        stage.journal.close()
        with pytest.raises(ClientError, match="cannot be read or written") as trouble:
            client.act(number, "acknowledge", Remark())
    assert (conflict.value.status, conflict.value.refused) == (409, True)
    assert (trouble.value.status, trouble.value.refused) == (503, False)
