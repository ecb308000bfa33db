"""``axiswatch status``: whether a running daemon monitors all axes, and which alarms are active."""

import json

import typer

from service.client import Client
from service.commands.alarms import alarm_lines
from service.commands.daemon_options import DEFAULT_URL, AsJson, Token, Url
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
    if as_json:
        print(json.dumps({**service, "active": active["total"], "unacknowledged": unacknowledged}, indent=1))
    else:
        print(f"axiswatch {service['version']} at {url}: {'ready' if service['ready'] else 'not ready'}")
        for line in (*service["reasons"], *service["messages"]):
            print(f"  {line}")
        print(f"active alarms: {active['total']}, unacknowledged: {unacknowledged}")
        for alarm in active["alarms"]:
            print(alarm_lines(alarm))
        if (left := active["total"] - len(active["alarms"])) > 0:
            print(f"{left} more: axiswatch alarms list --state active")
    raise typer.Exit(OK if service["ready"] else UNAVAILABLE)
