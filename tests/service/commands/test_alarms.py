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
from service.pipeline.alarm_recording import AlarmsSnapshot, as_recorded
from service.store.alarm_entries import Entry
from service.store.journal import Journal
from tests.end_to_end.processes import PATIENCE_S
from tests.service.command_line import as_json, axiswatch, refused, shown
from tests.service.web.conftest import FM_ALARM, NOON_US, Stage, serving

TLS = Path(__file__).parents[2] / "tls"


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
    assert shown("alarms", "list") == "no alarm\n"
    number = recorded(stage)
    words = "    fm is 0.018 N m s/rad (31 %, 24 to 37) above its nominal value\n"
    name, raised = f"{number}  demo.axis1 fm up", "medium priority, raised 2026-03-01 11:59:53 UTC"
    assert shown("alarms", "list") == f"{name}: unacknowledged, {raised}\n{words}"
    assert shown("alarms", "ack", number, "--comment", "I look") == f"{name}: acknowledged, {raised}\n{words}"
    hidden = shown("alarms", "shelve", number, "--for", "2h", "--work-order", "WO-17")
    until = "shelved until 2026-03-01 14:00:00 UTC"
    assert hidden == f"{name}: {until}, {raised}, work order WO-17\n{words}"
    assert shown("alarms", "list", "--state", "unacknowledged") == "no alarm is unacknowledged\n"
    assert until in shown("alarms", "list", "--state", "shelved", "--axis", "demo.axis1")
    assert shown("alarms", "unshelve", number).startswith(f"{name}: acknowledged")
    again = shown("alarms", "shelve", number, "--until", "2026-03-01T13:00:00Z")
    assert "shelved until 2026-03-01 13:00:00 UTC" in again
    recorded(stage, replace(FM_ALARM, ended_us=NOON_US))
    shown("alarms", "comment", number, "--comment", "gearbox changed", "--work-order", "WO-18")
    lines = shown("alarms", "show", number).splitlines()
    assert "ended 2026-03-01 12:00:00 UTC, work order WO-18" in lines[0]
    assert lines[2:10] == [
        "  onset: 2026-03-01 11:59:51 UTC (90 %: from 2026-03-01 11:59:50 UTC to 2026-03-01 11:59:51 UTC)",
        "  size: +0.01832 +- 0.0041 (95 %) N m s/rad; nominal value 0.06",
        "  cause: fm, probability 97 %",
        "  cause: kT, probability 3 %",
        "  2026-03-01 11:59:53 UTC  raise by axiswatch: unacknowledged",
        "  2026-03-01 12:00:00 UTC  acknowledge by local: acknowledged (I look)",
        "  2026-03-01 12:00:00 UTC  shelve by local: shelved until 2026-03-01 14:00:00 UTC (WO-17)",
        "  2026-03-01 12:00:00 UTC  unshelve by local: acknowledged",
    ]
    assert lines[-1].endswith("comment by local: shelved (gearbox changed) (WO-18)")


@pytest.mark.usefixtures("url")
def test_the_most_frequent_alarms_and_those_that_came_first(stage: Stage) -> None:
    number = recorded(stage)
    stage.record("demo.axis2", "1", 0.06, replace(FM_ALARM, raised_us=FM_ALARM.raised_us + 1))
    heads = shown("alarms", "list").splitlines()[::2]
    assert [head.rpartition(", ")[2] for head in heads] == [f"follows alarm {number}", "first-out"]
    lines = shown("alarms", "statistics").splitlines()
    assert lines[0] == "2026-02-22 12:00:00 UTC to 2026-03-01 12:00:00 UTC"
    assert lines[1] == "raised: 2, announced: 2"
    assert lines[2].startswith(
        "announced in ten minutes: 0.00198 in the mean, 2 at most (from 2026-03-01 11:5"
    )
    assert lines[4:] == ["     1  demo.axis1 fm up", "     1  demo.axis2 fm up"]
    assert shown("alarms", "statistics", "--until", "2026-03-01T11:00:00Z").count("raised: 0") == 1
    assert as_json("alarms", "statistics", "--json")["raised"] == 2


@pytest.mark.usefixtures("url")
def test_an_axis_is_taken_out_of_service_and_returned(stage: Stage) -> None:
    recorded(stage)
    done = shown("alarms", "out-of-service", "demo.axis1", "--comment", "oil", "--work-order", "WO-9")
    assert done == "demo.axis1: taken out of service by local at 2026-03-01 12:00:00 UTC (oil) (WO-9)\n"
    assert "out-of-service, medium" in shown("alarms", "list", "--state", "out-of-service")
    found = as_json("alarms", "return-to-service", "demo.axis1", "--json")
    assert (found["out_of_service"], len(found["steps"])) == (None, 2)


@pytest.mark.usefixtures("url")
def test_answers_as_json_are_those_of_the_api(stage: Stage) -> None:
    number = recorded(stage)
    assert as_json("alarms", "ack", number, "--json")["state"] == "acknowledged"
    assert [a["id"] for a in as_json("alarms", "list", "--json")["alarms"]] == [number]
    assert [t["event"] for t in as_json("alarms", "show", number, "--json")["transitions"]] == [
        "raise",
        "acknowledge",
    ]
    stage.healthy()
    found = as_json("status", "--json")
    assert (found["ready"], found["active"], found["unacknowledged"]) == (True, 1, 0)


@pytest.mark.usefixtures("url")
def test_an_alarm_that_is_not_yet_recorded_is_in_the_list(stage: Stage) -> None:
    entry = Entry("demo.axis1", "N m s/rad", 0.06, FM_ALARM, AlarmRules("high"))
    for number, first in (0, "not yet recorded"), (7, "7 not yet recorded"):
        waiting = AlarmsSnapshot(unrecorded=(as_recorded(entry, number, recorded=False),), waiting=1)
        stage.snapshot = replace(stage.snapshot, alarms=waiting)
        words = f"{first}  demo.axis1 fm up: unacknowledged, high priority"
        assert shown("alarms", "list").startswith(words)


def test_status_has_the_reasons_why_it_is_not_ready(stage: Stage, url: str) -> None:
    recorded(stage)
    lines = shown("status", code=4).splitlines()
    assert lines[0].endswith(f"at {url}: not ready")
    assert lines[1:3] == ["  bus can1: down: Network is down", "  demo.axis2: no sample yet"]
    assert lines[-3] == "active alarms: 1, unacknowledged: 1"
    assert lines[-2].startswith("1  demo.axis1 fm up: unacknowledged")
    stage.healthy()
    assert shown("status").splitlines()[0].endswith(f"at {url}: ready")


REFUSED = [
    (("unshelve", "1"), "axiswatch: not possible: unshelve; the alarm is unacknowledged: "),
    (("show", "77"), "axiswatch: no alarm 77; the journal holds 1"),
    (("shelve", "1", "--for", "8d"), "axiswatch: an alarm can be shelved for at most 7 days"),
    (("shelve", "1", "--until", "2026-03-01T11:00:00Z"), "only until a time in the future"),
    (("shelve", "1", "--until", "tomorrow"), "axiswatch: until: must be ISO 8601 with time zone"),
    (("shelve", "1", "--for", "soon"), "write a time, such as 10min"),
    (("shelve", "1"), "give one of --for and --until"),
    (("comment", "1"), "give --comment, --work-order or both"),
    (("list", "--state", "loud"), "'loud' is not one of"),
    (("return-to-service", "demo.axis1"), "axiswatch: no person has taken demo.axis1 out of service; "),
    (
        ("out-of-service", "demo.axis9"),
        "axiswatch: there is no axis 'demo.axis9'; there is demo.axis1, demo.axis2",
    ),
    (
        ("list", "--axis", "demo.axis9"),
        "axiswatch: there is no axis 'demo.axis9'; there is demo.axis1, demo.axis2",
    ),
    (("statistics", "--since", "noon"), "axiswatch: since: "),
    (("ack", "0"), "axiswatch: id: Input should be greater than or equal to 1"),
    (("ack", "1", "1"), "axiswatch: not possible: acknowledge; the alarm is acknowledged: "),
]


@pytest.mark.usefixtures("url")
def test_a_refusal_has_its_reason(stage: Stage) -> None:
    recorded(stage)
    for words, message in REFUSED:
        result = axiswatch("alarms", *words)
        assert result.exit_code == 2, words
        assert message in " ".join(result.stderr.replace("│", " ").split()), words


def test_a_daemon_that_does_not_answer_is_a_message_and_exit_code_4() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{free.getsockname()[1]}"
        for command in (("alarms", "list"), ("status",)):
            message = refused(*command, "--url", address, code=4)
            assert message.startswith(f"axiswatch: {address} does not answer (")
    assert "an address is http://HOST:PORT" in refused("status", "--url", "http://[::1", code=2)


def test_a_certificate_that_is_not_trusted_is_no_silence() -> None:
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(TLS / "localhost.crt", TLS / "localhost.key")
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def run() -> None:
            with suppress(OSError), context.wrap_socket(listener.accept()[0], server_side=True):
                pass

        thread = threading.Thread(target=run)
        thread.start()
        message = refused("status", "--url", f"https://127.0.0.1:{listener.getsockname()[1]}", code=4)
        thread.join(PATIENCE_S)
    assert "its certificate is not trusted here" in message
    assert "SSL_CERT_FILE" in message


def test_a_token_that_no_header_can_hold_is_not_shown(url: str) -> None:
    for token in ("axw_secret\n axw", "axw_secret\u00e9"):
        message = refused("status", "--url", url, "--token", token, code=2)
        assert "this is no token" in message
        assert "secret" not in message
    assert "ready" in shown("status", "--token", " axw_of_a_file\n", code=4)


@pytest.fixture
def answering() -> Iterator[Callable[[bytes], tuple[str, list[bytes]]]]:
    """A server that gives one answer, and keeps the request."""
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


def test_the_token_is_sent_and_another_server_is_named(
    answering: Callable[[bytes], tuple[str, list[bytes]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    address, requests = answering(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\nconnection: close\r\n\r\nhi")
    monkeypatch.setenv("AXISWATCH_TOKEN", "secret-7")
    message = refused("status", "--url", address, code=4)
    assert message == f"axiswatch: {address} is no axiswatch: it answers 200 without JSON"
    assert b"authorization: bearer secret-7" in requests[0].lower()


def test_a_refused_request_differs_from_a_daemon_in_trouble(stage: Stage, url: str) -> None:
    number = recorded(stage)
    with Client(url) as client:
        assert client.act(number, "acknowledge", Remark("seen"))["transitions"][-1]["comment"] == "seen"
        with pytest.raises(ClientError, match="the alarm is acknowledged") as conflict:
            client.act(number, "acknowledge")
        stage.journal.close()
        with pytest.raises(ClientError, match="cannot be read or written") as trouble:
            client.act(number, "acknowledge")
    assert (conflict.value.status, conflict.value.refused) == (409, True)
    assert (trouble.value.status, trouble.value.refused) == (503, False)
