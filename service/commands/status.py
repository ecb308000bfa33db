"""``axiswatch status``: whether a running daemon monitors all axes, and which alarms are active."""

import json

import typer

from service.client import Client
from service.commands.daemon_options import DEFAULT_URL, AsJson, Token, Url
from service.commands.exit_codes import OK, UNAVAILABLE, explained


def status(url: Url = DEFAULT_URL, token: Token = "", as_json: AsJson = False) -> None:
    """Print whether a running daemon monitors all axes, why not, and how many alarms are active.

    The exit code is 0 while all axes are monitored, else 4.
    """
    with explained(), Client(url, token) as client:
        service = client.service()
        active, unacknowledged = (
            client.alarms(state=state, limit=1)["total"] for state in ("active", "unacknowledged")
        )
    if as_json:
        print(json.dumps({**service, "active": active, "unacknowledged": unacknowledged}, indent=1))
    else:
        print(f"axiswatch {service['version']} at {url}: {'ready' if service['ready'] else 'not ready'}")
        for line in (*service["reasons"], *service["messages"]):
            print(f"  {line}")
        print(f"active alarms: {active}, unacknowledged: {unacknowledged}")
    raise typer.Exit(OK if service["ready"] else UNAVAILABLE)
