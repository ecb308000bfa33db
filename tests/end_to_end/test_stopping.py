"""The daemon stops although clients hold their connections, and a second signal does not wait."""

import contextlib
import fcntl
import signal
import socket
import struct
import termios
import time
from collections.abc import Iterator
from pathlib import Path

from tests.end_to_end.processes import PATIENCE_S, Daemon, daemon, demo_config, robot, wait_for
from tests.end_to_end.test_daemon import saved

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
    with (
        daemon(config) as d,
        robot(config),
        connection(d, REQUEST * MANY) as deaf,
        connection(d, REQUEST[:9]),
    ):
        wait_for(lambda: is_full(deaf))
        wait_for(lambda: d.axis()["counters"]["used"] > 0)
        d.process.send_signal(signal.SIGTERM)
        assert d.process.wait(PATIENCE_S) == 0
    assert [event["event"] for event in d.events() if "stop" in event["event"]] == ["stopping", "stopped"]
    assert [event for event in d.events() if event["level"] == "error"] == []
    assert saved(config).keys() == {"demo.axis1", "demo.axis2"}


def test_a_second_signal_ends_it_at_once(tmp_path: Path) -> None:
    with daemon(demo_config(tmp_path)) as d, connection(d, REQUEST * MANY) as deaf:
        wait_for(lambda: is_full(deaf))
        d.process.send_signal(signal.SIGTERM)
        wait_for(lambda: not catches(d.process.pid, signal.SIGTERM))
        d.process.send_signal(signal.SIGTERM)
        assert d.process.wait(PATIENCE_S) == -signal.SIGTERM


def catches(pid: int, number: signal.Signals) -> bool:
    """Whether a process handles that signal itself."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> (number - 1) & 1)
