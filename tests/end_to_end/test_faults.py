"""The daemon as a process where frames, its clients, the machine or the program itself are at fault."""

import contextlib
import fcntl
import json
import math
import resource
import signal
import socket
import struct
import termios
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.can.bus import open_bus, send
from service.can.frames import FrameKey
from service.config import load
from service.pipeline.axes.axis_monitors import FramePipeline
from service.simulation.robot import SimulatedFault
from service.store.journal import Journal
from tests.end_to_end.played_robot import played_robot
from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, edit, wait_for
from tests.end_to_end.saved_monitors import saved
from tests.service.command_line import axiswatch

UNRECORDED = "cannot be recorded yet, is tried again"
UNSAVED = "the state of the monitors cannot be saved"


def test_an_alarm_waits_for_a_full_disk_and_is_recorded_once_there_is_space(tmp_path: Path, seed: int) -> None:
    config = demo_config(tmp_path, axes=1, service="checkpoint_interval_s = 1.0")
    with daemon(config) as d:
        limit_files(d, 1)
        with played_robot(config, 20, seed, SimulatedFault("demo.axis1", {"fm": 1.6}, 4.0)):
            wait_for(lambda: any(UNRECORDED in message and " fm up" in message for message in messages(d)))
            wait_for(lambda: any(UNSAVED in message for message in messages(d)))
            before = d.axis()["last_sample"]
            waiting = d.get("api/v1/alarms?parameter=fm")["alarms"]
            assert [(alarm["id"], alarm["recorded"]) for alarm in waiting] == [(1, False)], "shown at once"
            assert "alarm" in [p["status"] for p in d.axis()["parameters"]]
            assert (d.status("healthz"), d.status("readyz")) == (200, 503)
            limit_files(d, resource.RLIM_INFINITY)
            wait_for(lambda: all(a["recorded"] for a in d.get("api/v1/alarms?parameter=fm")["alarms"]))
            wait_for(lambda: not messages(d))
        alarms = d.get("api/v1/alarms?parameter=fm")["alarms"]
        assert min(alarm["raised"] for alarm in alarms) <= before
        assert 1 in [alarm["id"] for alarm in alarms], "under the number that was shown"
        assert len({(alarm["direction"], alarm["raised"]) for alarm in alarms}) == len(alarms), "recorded once"
        assert d.get("api/v1/service")["checkpoint"] is not None
        assert d.stop() == 0


def limit_files(d: Daemon, octets: int) -> None:
    """No file of the daemon may be written beyond that size: its disk is full."""
    _, most = resource.prlimit(d.process.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(d.process.pid, resource.RLIMIT_FSIZE, (most if octets < 0 else octets, most))


def messages(d: Daemon) -> list[str]:
    found: list[str] = d.get("api/v1/service")["messages"]
    return found


def test_a_fault_of_the_program_ends_it_with_1_and_a_clear_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def update(_: FramePipeline) -> None:
        raise ZeroDivisionError("division by a fault")

    monkeypatch.setattr(FramePipeline, "update", update)
    done = axiswatch("run", "--config", demo_config(tmp_path, axes=1), "--port", "0")
    assert done.exit_code == 1
    *log, last = done.stderr.splitlines()
    assert last == "axiswatch: a fault in the worker has stopped the daemon; the log says what"
    (failure,) = [event for event in map(json.loads, log) if event["level"] == "critical"]
    assert failure["event"] == "the worker has failed; the daemon stops"
    (exception,) = failure["exception"]
    assert (exception["exc_type"], exception["exc_value"]) == ("ZeroDivisionError", "division by a fault")
    assert exception["frames"][-1]["name"] == "update"
    Journal(tmp_path / "state" / "alarms.sqlite").close()  # nobody holds it any longer
    assert not {"worker", "reader-can0"} & {thread.name for thread in threading.enumerate()}


# --- values and frames that are not as they should be -----------------------------------------------------------------


FLOATS = """VERSION ""

NS_ :

BS_:

BU_: Controller

BO_ 385 Axis1State: 8 Controller
 SG_ Torque : 0|32@1- (1,0) [0|0] "N m" Controller
 SG_ Angle : 32|32@1- (1,0) [0|0] "rad" Controller

SIG_VALTYPE_ 385 Torque : 1;
SIG_VALTYPE_ 385 Angle : 1;
"""
KEY = FrameKey(385, False)


def test_values_that_are_none_and_short_frames_change_nothing_and_a_second_signal_ends_it(
    tmp_path: Path,
) -> None:
    """They are counted.  At the end a client does not read, for which the daemon would wait."""
    counter = ('counter_message = "Axis1State"\ncounter_signal = "Counter"\n', "")
    config = edit(demo_config(tmp_path, axes=1), counter)
    (tmp_path / "demo.dbc").write_text(FLOATS, encoding="utf-8")
    with daemon(config) as d:
        bus = open_bus(load(config, {}).bus[0])
        for k in range(20):  # a good sample first and last
            time.sleep(0.005)
            torque, angle = (math.nan, math.inf)[k % 2], 0.0
            send(bus, KEY, struct.pack("<ff", torque if 5 <= k < 15 else 0.0, angle))
            if k == 10:
                send(bus, KEY, b"\0\0\0")
        axis = wait_for(lambda: _with(d, 1))
        bus.shutdown()
        assert axis["dropped"]["not_finite"] == 20  # torque and angle of ten frames
        assert [p["estimate"] for p in axis["parameters"]] == [p["nominal"] for p in axis["parameters"]]
        assert d.get("api/v1/service")["buses"][0]["dropped"]["too_short"] == 1
        assert 'axiswatch_frames_dropped_total{bus="can0",reason="too_short"} 1.0' in d.text("metrics")
        assert 'axiswatch_values_dropped_total{axis="demo.axis1",reason="not_finite"} 20.0' in d.text("metrics")
        ends_at_once_by_a_second_signal(d)


def _with(d: Daemon, samples: int) -> dict[str, Any] | None:
    """The axis, once it has some good samples and all of the bad values."""
    axis = d.axis()
    return axis if axis["samples"] >= samples and axis["dropped"]["not_finite"] >= 20 else None


# --- clients that do not read, and signals ----------------------------------------------------------------------------


REQUEST = b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n"
MANY = 300
"""Answers of this number do not fit into the buffers of a connection."""


@contextlib.contextmanager
def connection(d: Daemon, sent: bytes) -> Iterator[socket.socket]:
    """A client that has sent this, and never reads."""
    with socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", int(d.page.rstrip("/").rpartition(":")[2])))
        client.sendall(sent)
        yield client


def is_full(client: socket.socket) -> bool:
    """Whether more does not come: what waits to be read stays as much."""

    def waiting() -> int:
        return int(struct.unpack("i", fcntl.ioctl(client, termios.FIONREAD, b"\0" * 4))[0])

    before = waiting()
    time.sleep(0.2)
    return before == waiting() > 0


def test_slow_clients_do_not_hold_it_and_a_last_checkpoint_is_saved(tmp_path: Path) -> None:
    config = demo_config(tmp_path, service="checkpoint_interval_s = 3600")
    with daemon(config) as d, connection(d, REQUEST * MANY) as deaf, connection(d, REQUEST[:9]):
        wait_for(lambda: is_full(deaf))
        d.process.send_signal(signal.SIGTERM)
        assert d.process.wait(PATIENCE_S) == 0
    assert [event["event"] for event in d.events() if "stop" in event["event"]] == ["stopping", "stopped"]
    assert [event for event in d.events() if event["level"] in ("error", "critical")] == []
    assert saved(config).keys() == {"demo.axis1", "demo.axis2"}


def ends_at_once_by_a_second_signal(d: Daemon) -> None:
    with connection(d, REQUEST * MANY) as deaf:
        wait_for(lambda: is_full(deaf))
        d.process.send_signal(signal.SIGTERM)
        wait_for(lambda: not catches(d.process.pid, signal.SIGTERM))
        d.process.send_signal(signal.SIGTERM)
        assert d.process.wait(PATIENCE_S) == -signal.SIGTERM
    assert "stopping" not in [event["event"] for event in d.events()], "it has not waited for the client"


def catches(pid: int, number: signal.Signals) -> bool:
    """Whether a process handles that signal itself."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> (number - 1) & 1)
