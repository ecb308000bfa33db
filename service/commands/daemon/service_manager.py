"""Reports to systemd: ready, status, alive, stopping (sd_notify(3), $NOTIFY_SOCKET); does nothing without systemd.

The protocol is a few short datagrams, for which a library is not worth the dependency.
"""

import os
import socket
import threading
from collections.abc import Callable, Mapping

import structlog

from monitor_core.wording import listed
from service.pipeline.silence import silent_after_s
from service.pipeline.snapshot import AxisSnapshot, Snapshot

_WITHOUT_WATCHDOG_S = 5.0
"""Time between two checks of the status [s]"""
_LOOKS = 4
"""Notifications within the time-out of the watchdog"""
_SEND_S = 1.0
_MOST_NAMES = 3
"""Most axes that a status names"""

log = structlog.get_logger(__name__)


class ServiceManager:
    """Reports the state of the daemon to systemd from a thread of its own, between ``ready`` and ``close``.

    The watchdog is notified when all loops have made progress since the last notification.  They also do so while a bus
    is silent or down, so that systemd does not kill the daemon when a robot is switched off.

    Args:
        environ: variables that systemd has set: NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID.
        turns: number of cycles of each loop, by its name.
        status: returns the state of the daemon in a line.
    """

    def __init__(
        self, environ: Mapping[str, str], turns: Callable[[], Mapping[str, int]], status: Callable[[], str]
    ) -> None:
        self._address = _address(environ.get("NOTIFY_SOCKET", ""))
        self._watchdog_s = _watchdog_s(environ)
        self._turns, self._status = turns, status
        self._fed_at: Mapping[str, int] = {}
        self._still: list[str] = []
        self._shown = ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="service-manager", daemon=True)

    def ready(self) -> None:
        """Report that the service is up; from now on its status and the watchdog notifications are sent."""
        if self._address is not None:
            self._shown = self._status()
            self._send("READY=1", f"STATUS={self._shown}")
            self._thread.start()

    def stopping(self) -> None:
        """Report that the service is stopping."""
        self.close()
        self._send("STOPPING=1", "STATUS=stopping: the last frames are processed and saved")

    def close(self) -> None:
        """End the thread if it runs."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def update_status(self) -> None:
        """Send a new status, and notify the watchdog if all loops of the daemon have made progress."""
        lines = []
        if (status := self._status()) != self._shown:
            self._shown = status
            lines.append(f"STATUS={status}")
        if self._watchdog_s is not None and self._all_turned():
            lines.append("WATCHDOG=1")
        if lines:
            self._send(*lines)

    def _run(self) -> None:
        wait_s = _WITHOUT_WATCHDOG_S if self._watchdog_s is None else self._watchdog_s / _LOOKS
        while not self._ended.wait(wait_s):
            self.update_status()

    def _all_turned(self) -> bool:
        turns = self._turns()
        still = [name for name, count in turns.items() if count == self._fed_at.get(name)]
        if still and still != self._still:
            log.error("a thread makes no progress, so the watchdog is not notified", threads=still)
        self._still = still
        if not still:
            self._fed_at = turns
        return not still

    def _send(self, *lines: str) -> None:
        if self._address is None:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.settimeout(_SEND_S)
                sender.sendto("\n".join(lines).encode(), self._address)
        except OSError as error:  # monitoring must go on without systemd
            log.warning("systemd cannot be reached", reason=str(error))


def _address(name: str) -> str | None:
    """The address of a socket by its name: a path, or @ and an abstract name; None: unusable name."""
    return name.replace("@", "\0", 1) if name.startswith(("/", "@")) else None


def _watchdog_s(environ: Mapping[str, str]) -> float | None:
    """The time-out of systemd's watchdog for this process [s]."""
    wanted = environ.get("WATCHDOG_USEC", "")
    own = environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return int(wanted) * 1e-6 if own and wanted.isdecimal() and int(wanted) else None


def status_line(snapshot: Snapshot) -> str:
    """The state of the daemon in a line, for `systemctl status`."""
    active = sum(len(axis.open_alarms) for axis in snapshot.axes)
    parts = [
        f"monitoring {len(snapshot.axes)} ax{'is' if len(snapshot.axes) == 1 else 'es'}",
        f"{active or 'no'} active alarm{'' if active == 1 else 's'}",
    ]
    if down := [bus.name for bus in snapshot.buses if not bus.up]:
        parts.append(f"bus {listed(down)} down")
    if silent := [axis.id for axis in snapshot.axes if _is_silent(axis, snapshot)]:
        parts.append(f"no samples of {listed(silent) if len(silent) <= _MOST_NAMES else f'{len(silent)} axes'}")
    more = [f"{len(snapshot.messages) - 1} more messages"] if len(snapshot.messages) > 1 else []
    return "; ".join([", ".join(parts), *snapshot.messages[:1], *more]).replace("\n", " ")


def _is_silent(axis: AxisSnapshot, snapshot: Snapshot) -> bool:
    """Whether an axis has no samples now; in the first seconds after the start they may not have come yet."""
    is_new = (snapshot.taken_us - snapshot.started_us) * 1e-6 <= silent_after_s(axis.interval_s)
    return axis.silent_since_us is not None or (axis.status.time_us is None and not is_new)
