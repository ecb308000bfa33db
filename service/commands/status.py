"""``axiswatch status``: whether a running daemon monitors all axes, and which alarms are active."""

import typer

from service.client import ClientError
from service.commands.alarms import alarm_lines
from service.commands.daemon_options import Daemon, asks_daemon
from service.commands.exit_codes import OK, UNAVAILABLE

MOST = 10
"""Most alarms that are described"""
_UNAVAILABLE_STATUS = 503


@asks_daemon
def status(daemon: Daemon) -> None:
    """Print whether a running daemon monitors all axes, why not, and which alarms are active.

    The exit code is 0 while all axes are monitored, else 4.
    """
    service = daemon.client.service()
    lines = [
        f"axiswatch {service['version']} at {daemon.url}: {'ready' if service['ready'] else 'not ready'}",
        *(f"  {line}" for line in (*service["reasons"], *service["messages"])),
    ]
    try:
        active = daemon.client.alarms(state="active", limit=MOST)
        unacknowledged = daemon.client.alarms(state="unacknowledged", limit=1)["total"]
    except ClientError as error:
        # Where the alarm journal cannot be read, the messages say more than the refusal.
        if error.status != _UNAVAILABLE_STATUS:
            raise
        daemon.show({**service, "active": None, "unacknowledged": None}, [*lines, f"alarms: {error}"])
        raise typer.Exit(UNAVAILABLE) from None
    found = {**service, "active": active["total"], "unacknowledged": unacknowledged}
    left = active["total"] - len(active["alarms"])
    lines += [
        f"active alarms: {active['total']}, unacknowledged: {unacknowledged}",
        *map(alarm_lines, active["alarms"]),
        *([f"{left} more: axiswatch alarms list --state active"] if left > 0 else []),
    ]
    daemon.show(found, lines)
    raise typer.Exit(OK if service["ready"] else UNAVAILABLE)
