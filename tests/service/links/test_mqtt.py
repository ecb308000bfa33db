"""The link to a broker against a real one, mosquitto, over TLS with a password."""

import base64
import hashlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
import pytest
import structlog
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion

from service.config.schema import LinksConfig
from service.links.mqtt import States, state_body
from service.web import views
from tests.conftest import ROOT
from tests.end_to_end.processes import wait_for
from tests.ports import own_port
from tests.service.links.journals import just_raised, linked, record
from tests.service.web.conftest import NOON_US, whole_snapshot

TLS = ROOT / "tests" / "tls"
PASSWORD = "hunter2 and more"


def hashed(password: str) -> str:
    """As mosquitto_passwd writes it: PBKDF2 with SHA-512."""
    salt = b"twelve bytes"
    key = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, 101)
    return f"$7$101${base64.b64encode(salt).decode()}${base64.b64encode(key).decode()}"


class Broker:
    """A mosquitto that lets in over TLS with a password, and an observer of it without either."""

    def __init__(self, program: str, folder: Path) -> None:
        self.program, self.folder, self.process = program, folder, None
        self.port, self._plain = (own_port() for _ in range(2))
        (folder / "passwords").write_text(f"cell1:{hashed(PASSWORD)}\n")
        (folder / "password").write_text(PASSWORD + "\n")
        (folder / "broker.conf").write_text(
            "per_listener_settings true\nuser root\n"
            f"listener {self._plain} 127.0.0.1\nallow_anonymous true\n"
            f"listener {self.port} 127.0.0.1\nallow_anonymous false\npassword_file {folder}/passwords\n"
            f"certfile {TLS}/localhost.crt\nkeyfile {TLS}/localhost.key\n"
        )

    process: subprocess.Popen[bytes] | None

    def start(self) -> None:
        command = [self.program, "-c", str(self.folder / "broker.conf")]
        self.process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        wait_for(self._listens)

    def _listens(self) -> bool:
        try:
            socket.create_connection(("127.0.0.1", self.port), 1).close()
        except OSError:
            return False
        return True

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    @contextmanager
    def observed(self) -> Iterator[list[tuple[str, Any, bool]]]:
        """Topic, content and whether it was retained, of all messages from now on."""
        seen = list[tuple[str, Any, bool]]()

        def on_message(_client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
            text = message.payload.decode()
            seen.append((message.topic, json.loads(text) if text[:1] == "{" else text, message.retain))

        client = paho.Client(CallbackAPIVersion.VERSION2, protocol=MQTTProtocolVersion.MQTTv5)
        client.on_message = on_message
        client.on_connect = lambda c, *_: c.subscribe("#", 1)
        subscribed = list[int]()
        client.on_subscribe = lambda _c, _d, mid, *_: subscribed.append(mid)
        client.connect("127.0.0.1", self._plain)
        client.loop_start()
        try:
            wait_for(lambda: subscribed)
            yield seen
        finally:
            client.disconnect()
            client.loop_stop()

    @property
    def table(self) -> dict[str, Any]:
        """[links.mqtt]"""
        return {
            "host": "localhost",
            "port": self.port,
            "ca_file": str(TLS / "localhost.crt"),
            "user": "cell1",
            "password_file": str(self.folder / "password"),
            "prefix": "plant/cell1",
            "interval_s": 1.0,
        }

    def config(self, **changes: Any) -> LinksConfig:
        return LinksConfig.model_validate({"mqtt": self.table | changes})


@pytest.fixture
def broker(tmp_path: Path, need: Callable[[str], str]) -> Iterator[Broker]:
    started = Broker(need("mosquitto"), tmp_path)
    started.start()
    yield started
    started.stop()


def test_status_states_and_alarms(broker: Broker, tmp_path: Path) -> None:
    with broker.observed() as seen, linked(broker.config(), tmp_path) as (links, journal):
        record(journal, just_raised(), "demo.axis1")
        wait_for(lambda: len(seen) == 4)
        record(journal, replace(just_raised(), parameter="fm"), "demo.axis2")
        wait_for(lambda: len(seen) == 5)
        time.sleep(1.2)  # another interval, in which no state has changed
        wait_for(lambda: (links.snapshots()[0].delivered, links.snapshots()[0].pending) == (2, 0))
        (link,) = links.snapshots()
        found = {topic: body for topic, body, _ in seen}
        assert found["plant/cell1/status"] == "online"
        axis = views.axis(whole_snapshot().axes[0], NOON_US).model_dump(mode="json")
        state = found["plant/cell1/demo/axis1/state"]
        kT = state["parameters"][0]
        assert {name: state[name] for name in state if name != "parameters"} == {
            name: axis[name] for name in state if name != "parameters"
        }
        deviation = kT.pop("deviation")
        assert deviation == pytest.approx(0.99317 - 1)
        assert kT == {name: axis["parameters"][0][name] for name in kT}
        alarm = found["plant/cell1/demo/axis2/alarm"]
        assert (alarm["event"], alarm["alarm"]["axis"]) == ("raise", "demo.axis2")
        assert alarm["alarm"]["words"].startswith("something has changed, at first sight fm")
        assert (link.delivered, link.pending, link.connected, link.problem) == (2, 0, True, "")
        with broker.observed() as later:  # one that comes later sees what is retained, not the alarms
            wait_for(lambda: len(later) == 3)
            assert all(retained for *_, retained in later)
            assert {topic for topic, *_ in later} == {
                "plant/cell1/status",
                "plant/cell1/demo/axis1/state",
                "plant/cell1/demo/axis2/state",
            }
        assert len(seen) == 5
        links.stop()
        wait_for(lambda: seen[5:])
        assert seen[5:] == [("plant/cell1/status", "offline", False)]


def test_alarms_of_while_the_broker_was_down_come_in_their_order(
    broker: Broker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.links.delivery.FIRST_RETRY_S", 0.1)
    with structlog.testing.capture_logs() as logs, linked(broker.config(), tmp_path) as (links, journal):
        wait_for(lambda: links.snapshots()[0].connected)
        broker.stop()
        wait_for(lambda: not links.snapshots()[0].connected)
        for k in range(5):
            record(journal, just_raised(), f"demo.axis{k}")
        wait_for(lambda: links.snapshots()[0].pending == 5)
        assert links.snapshots()[0].problem.startswith(f"localhost:{broker.port}: ")
        broker.start()
        with broker.observed() as seen:
            wait_for(lambda: links.snapshots()[0].delivered == 5)
            wait_for(lambda: [topic for topic, *_ in seen if topic.endswith("status")])
    assert links.snapshots()[0].pending == 0
    alarms = [topic for topic, *_ in seen if topic.endswith("/alarm")]
    expected = [f"plant/cell1/demo/axis{k}/alarm" for k in range(5)]
    assert alarms == expected[len(expected) - len(alarms) :]  # the observer may have come after the first
    assert [e["event"] for e in logs if e["event"].startswith("a link is")][:2] == [
        "a link is up",
        "a link is down",
    ]
    assert PASSWORD not in str(logs)


KILLED = """
import json, sys, time
from pathlib import Path
from service.config.schema import LinksConfig
from service.links.running import Links
from service.store.journal import Journal
from tests.service.web.conftest import whole_snapshot
folder = Path(sys.argv[1])
config = LinksConfig.model_validate({"mqtt": json.loads(sys.argv[2])})
links = Links(config, folder, Journal(folder / "alarms.sqlite"), whole_snapshot)
links.start()
time.sleep(60)
"""


def test_the_last_will_of_a_daemon_that_is_killed(broker: Broker, tmp_path: Path) -> None:
    text = json.dumps(broker.table)
    with (
        broker.observed() as seen,
        subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path), text], cwd=ROOT) as process,
    ):
        wait_for(lambda: ("plant/cell1/status", "online", False) in seen)
        os.kill(process.pid, signal.SIGKILL)
        wait_for(lambda: ("plant/cell1/status", "offline", False) in seen)


# paho leaves the socket of a handshake that has failed to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("changes", "words"),
    [({"user": "cell2"}, "Not authorized"), ({"ca_file": None}, "certificate verify failed")],
)
def test_who_is_not_let_in_says_why(changes: dict[str, Any], words: str, broker: Broker, tmp_path: Path) -> None:
    with linked(broker.config(**changes), tmp_path) as (links, _):
        wait_for(lambda: words.lower() in links.snapshots()[0].problem.lower())
        assert links.snapshots()[0].connected is False
        assert PASSWORD not in links.snapshots()[0].problem


def test_a_state_is_published_once_in_an_interval_and_only_if_it_has_changed() -> None:
    snapshot, clock = [whole_snapshot()], [0.0]
    states = States(lambda: snapshot[0], 10.0, lambda: clock[0])

    def due() -> list[str]:
        return [found[0] for found in iter(states.next, None)]

    assert due() == ["demo.axis1", "demo.axis2"]
    axis = snapshot[0].axes[0]
    snapshot[0] = replace(snapshot[0], axes=(replace(axis, gated_by="mode = 2"), snapshot[0].axes[1]))
    clock[0] = 9.0
    assert due() == []
    clock[0] = 10.0
    assert due() == ["demo.axis1"]
    clock[0] = 20.0
    assert due() == []
    assert state_body(snapshot[0].axes[0], NOON_US).gated_by == "mode = 2"
