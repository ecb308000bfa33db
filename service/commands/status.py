"""``axiswatch status``: whether a running daemon monitors all axes, and which alarms are active."""

import typer

from service.commands.alarms import alarm_lines
from service.commands.command_line.daemon_options import Daemon, asks_daemon
from service.commands.command_line.exit_codes import OK, UNAVAILABLE

MOST = 10
"""Most alarms that are described"""


@asks_daemon
def status(daemon: Daemon) -> None:
    """Print whether a running daemon monitors all axes, why not, and which alarms are active.

    The exit code is 0 while all axes are monitored, else 4.
    """
    service = daemon.client.service()
    active = daemon.client.alarms(state="active", limit=MOST)
    unacknowledged = daemon.client.alarms(state="unacknowledged", limit=1)["total"]
    found = {**service, "active": active["total"], "unacknowledged": unacknowledged}
    left = active["total"] - len(active["alarms"])
    lines = [
        f"axiswatch {service['version']} at {daemon.url}: {'ready' if service['ready'] else 'not ready'}",
        *(f"  {line}" for line in (*service["reasons"], *service["messages"])),
        f"active alarms: {active['total']}, unacknowledged: {unacknowledged}",
        *map(alarm_lines, active["alarms"]),
        *([f"{left} more: axiswatch alarms list --state active"] if left > 0 else []),
    ]
    daemon.show(found, lines)
    raise typer.Exit(OK if service["ready"] else UNAVAILABLE)
