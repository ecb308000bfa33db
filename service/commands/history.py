"""``axiswatch history``: the history of an axis of a running daemon, in a file."""

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Literal

import typer

from monitor_core.wording import seconds_in
from service.client import Client
from service.commands.command_line.daemon_options import DEFAULT_URL, Token, Url
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.output_files import STDOUT, check_writable, write

Axis = Annotated[str, typer.Argument(metavar="ROBOT.AXIS", help="Id of the axis.")]
Since = Annotated[
    str | None,
    typer.Option(
        "--since",
        metavar="TIME",
        help="Start: ISO 8601 with time zone, 2026-03-01T12:00:00Z, or a time before now: 7d, 12h.",
        show_default="start of the history",
    ),
]
Until = Annotated[
    str | None, typer.Option("--until", metavar="TIME", help="End, in the same form.", show_default="now")
]
Parameter = Annotated[
    str | None, typer.Option("--parameter", metavar="NAME", help="Only this parameter.", show_default="all")
]
ResolutionName = Annotated[
    Literal["raw", "minute", "hour", "day"] | None,
    typer.Option(
        "--resolution",
        help="Length of a row; raw: as recorded.",
        show_default="the finest that goes back to TIME",
    ),
]
Output = Annotated[
    Path,
    typer.Option("--output", "-o", metavar="FILE", help="A new .csv or .parquet file; - is standard output, as CSV."),
]


def history(
    axis: Axis,
    since: Since = None,
    until: Until = None,
    parameter: Parameter = None,
    resolution: ResolutionName = None,
    output: Output = STDOUT,
    url: Url = DEFAULT_URL,
    token: Token = "",
) -> None:
    """Write the history of an axis, as a running daemon keeps it, to a CSV or Parquet file.

    A row for each parameter and time: number of points, and mean, minimum and maximum of the estimate, its deviation
    from the nominal value, its standard deviation, both CUSUMs, their threshold, and the observability.
    """
    kind = "csv" if output == STDOUT else output.suffix.removeprefix(".")
    if kind not in ("csv", "parquet"):
        raise typer.BadParameter(f"{output} is neither .csv nor .parquet", param_hint="--output")
    if output != STDOUT:
        check_writable(output)
    query = {
        "since": _time_argument(since, "--since"),
        "until": _time_argument(until, "--until"),
        "parameter": parameter,
        "resolution": resolution,
    }
    with explained(), Client(url, token) as client:
        content = client.history_file(axis, kind, **query)
        if output == STDOUT:
            sys.stdout.write(content.decode("utf-8"))
        else:
            write(output, content)
            print(f"written: {output}")


def _time_argument(text: str | None, option: str) -> str | None:
    """A time as given, which the daemon checks, or a duration before now."""
    if text is None or "T" in text or " " in text:
        return text
    try:
        return (datetime.now(UTC) - timedelta(seconds=seconds_in(text))).isoformat()
    except (ValueError, OverflowError):
        message = f"{text!r} is no time: 2026-03-01T12:00:00Z, or 7d for seven days ago"
        raise typer.BadParameter(message, param_hint=option) from None
