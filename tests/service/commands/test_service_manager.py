"""What systemd hears of the daemon, by a socket as systemd's."""

import os
import re
import socket
import threading
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from service.commands.daemon.service_manager import ServiceManager, status_line
from service.pipeline.persistence.recording import Recording
from service.pipeline.worker import COMPILING
from tests.end_to_end.processes import PATIENCE_S, wait_for
from tests.service.daemon_thread import daemon_thread
from tests.service.pipeline.robots import demo
from tests.service.web.conftest import NOON_US, whole_snapshot

NAME = "notify"


class Systemd:
    """The receiving end, which keeps all that it gets."""

    def __init__(self, address: str) -> None:
        self.heard = list[str]()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address)
        self._socket.setblocking(False)

    def lines(self) -> list[str]:
        """All lines until now."""
        try:
            while True:
                self.heard += self._socket.recv(65536).decode().split("\n")
        except BlockingIOError:
            return self.heard

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[Systemd]:
    heard = Systemd(str(tmp_path / NAME))
    yield heard
    heard.close()


def manager(folder: Path, turns: Mapping[str, int], **variables: str) -> ServiceManager:
    environ = {"NOTIFY_SOCKET": str(folder / NAME), "WATCHDOG_USEC": "3600000000", **variables}
    return ServiceManager(environ, lambda: dict(turns), lambda: "all is well")


def test_the_watchdog_is_fed_when_reader_and_worker_have_turned_since(tmp_path: Path, systemd: Systemd) -> None:
    turns = {"reader can0": 0, "worker": 0}
    notifier = manager(tmp_path, turns)
    notifier.update_status()
    assert systemd.lines() == ["STATUS=all is well", "WATCHDOG=1"]
    for still, moves in (("worker", "reader can0"), ("reader can0", "worker")):
        systemd.heard.clear()
        with capture_logs() as logs:
            for _ in range(3):
                turns[moves] += 1
                notifier.update_status()
        assert systemd.lines() == []
        assert [(entry["log_level"], entry["threads"]) for entry in logs] == [("error", [still])]
        turns[still] += 1
        notifier.update_status()
        assert systemd.lines() == ["WATCHDOG=1"]


@pytest.mark.parametrize(
    "variables",
    [{"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": ""}, {"WATCHDOG_USEC": "x"}, {"WATCHDOG_PID": "1"}],
    ids=str,
)
def test_a_watchdog_that_is_off_or_for_another_process_is_not_fed(
    variables: dict[str, str], tmp_path: Path, systemd: Systemd
) -> None:
    manager(tmp_path, {}, **variables).update_status()
    assert systemd.lines() == ["STATUS=all is well"]


def test_an_abstract_socket_is_reached() -> None:
    name = f"axiswatch-test-{os.getpid()}"
    heard = Systemd(f"\0{name}")
    ServiceManager({"NOTIFY_SOCKET": f"@{name}"}, dict, lambda: "here").update_status()
    assert heard.lines() == ["STATUS=here"]
    heard.close()


@pytest.mark.parametrize("name", ["", "vsock:2:1234", "/no/such/socket"])
def test_without_a_socket_that_answers_the_daemon_goes_on(name: str) -> None:
    notifier = ServiceManager({"NOTIFY_SOCKET": name}, dict, lambda: "here")
    notifier.ready()
    notifier.stopping()
    notifier.close()


def test_systemd_follows_the_daemon_and_a_worker_that_is_stuck_is_not_kept_alive(
    tmp_path: Path, systemd: Systemd, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a silent bus: a robot that is switched off."""
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / NAME))
    monkeypatch.setenv("WATCHDOG_USEC", "1000000")
    stuck, stands, go_on = (threading.Event() for _ in range(3))
    looks = list[int]()
    update_status = ServiceManager.update_status

    def blocked(_: Recording) -> None:
        if stuck.is_set():
            stands.set()
            go_on.wait()

    def counted(notifier: ServiceManager) -> None:
        update_status(notifier)
        looks.append(systemd.lines().count("WATCHDOG=1"))

    monkeypatch.setattr(Recording, "tick", blocked)
    monkeypatch.setattr(ServiceManager, "update_status", counted)
    with daemon_thread(demo(tmp_path, 1)):
        try:
            wait_for(lambda: looks and looks[-1] > 3)
            ready, status = systemd.lines()[:2]
            assert ready == "READY=1"
            expected = f"STATUS=monitoring 1 axis, no active alarms(; {re.escape(COMPILING)})?.*"
            assert re.fullmatch(expected, status)
            stuck.set()
            assert stands.wait(PATIENCE_S)
            first = len(looks)
            wait_for(lambda: len(looks) > first + 6)
            fed = looks[first + 2 :]
            assert fed[0] == fed[-1], "twice at most after it: the update in progress, and the cycle before it"
            go_on.set()
            wait_for(lambda: looks[-1] > fed[-1])
        finally:
            go_on.set()
    assert "STOPPING=1" in systemd.lines()[-2:]
    assert systemd.lines().count("READY=1") == 1


def test_the_status_says_which_axes_have_no_samples() -> None:
    """The second axis has never had any, since ten minutes."""
    snapshot = whole_snapshot()
    first, second = snapshot.axes
    waits = "monitoring 2 axes, 1 active alarm, bus can1 down, no samples of "
    assert status_line(snapshot).startswith(f"{waits}demo.axis2;")
    stopped = replace(first, silent_since_us=NOON_US - 60_000_000)
    assert status_line(replace(snapshot, axes=(stopped, second))).startswith(f"{waits}demo.axis1 and demo.axis2;")
    assert "no samples" not in status_line(replace(snapshot, started_us=NOON_US - 1_000_000))
    many = tuple(replace(stopped, id=f"demo.axis{k}", open_alarms=()) for k in range(12))
    assert "no samples of 12 axes" in status_line(replace(snapshot, axes=many))
