"""Consent to send on a bus where a drive may listen: only ``simulate`` and ``play`` send at all."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Annotated

import typer

from service.can.bus import BusSettings, reaches_hardware
from service.commands.exit_codes import MISTAKE

SendYes = Annotated[
    bool, typer.Option("--yes", help="Send on a real CAN interface without asking: a drive there may move.")
]


def confirm_sending(buses: Iterable[BusSettings], yes: bool) -> None:
    """Ask before frames are sent on buses that may have drives; without a terminal ``yes`` is needed.

    Raises:
        typer.Exit: with status 2, where there is no consent.
    """
    real = [f"{bus.interface} {bus.channel}" for bus in buses if reaches_hardware(bus)]
    if yes or not real:
        return
    danger = (
        f"this sends frames on {', '.join(real)}: a drive or controller that listens there may act on them"
    )
    if not sys.stdin.isatty():
        print(f"axiswatch: {danger}. Give --yes if none does, or use a virtual bus (vcan0).", file=sys.stderr)
        raise typer.Exit(MISTAKE)
    print(f"{danger[0].upper()}{danger[1:]}.")
    if not typer.confirm("Send?", default=False):
        raise typer.Exit(MISTAKE)
