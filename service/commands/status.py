"""``axiswatch status``: whether a running daemon monitors all axes, and which alarms are active."""

import typer

from service.client import Client
from service.commands.alarms import alarm_lines
from service.commands.daemon_options import DEFAULT_URL, AsJson, Token, Url, print_answer
from service.commands.exit_codes import OK, UNAVAILABLE, explained

MOST = 10
"""Alarms that are described"""


def status(url: Url = DEFAULT_URL, token: Token = "", as_json: AsJson = False) -> None:
    """Print whether a running daemon monitors all axes, why not, and which alarms are active.

    The exit code is 0 while all axes are monitored, else 4.
    """
    with explained(), Client(url, token) as client:
        service = client.service()
        active = client.alarms(state="active", limit=MOST)
        unacknowledged = client.alarms(state="unacknowledged", limit=1)["total"]
    found = {**service, "active": active["total"], "unacknowledged": unacknowledged}
    left = active["total"] - len(active["alarms"])
    lines = [
        f"axiswatch {service['version']} at {url}: {'ready' if service['ready'] else 'not ready'}",
        *(f"  {line}" for line in (*service["reasons"], *service["messages"])),
        f"active alarms: {active['total']}, unacknowledged: {unacknowledged}",
        *map(alarm_lines, active["alarms"]),
        *([f"{left} more: axiswatch alarms list --state active"] if left > 0 else []),
    ]
    print_answer(found, as_json, lines)
    raise typer.Exit(OK if service["ready"] else UNAVAILABLE)
