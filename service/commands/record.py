"""``axiswatch record``: the raw frames of the last minutes of a running daemon, in a file."""

from pathlib import Path
from typing import Annotated

import typer

from service.client import Client
from service.commands.command_line.daemon_options import DEFAULT_URL, Token, Url
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.output_files import check_writable, write

Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Also copy it to this file, .log or .blf as it is.",
    ),
]
Name = Annotated[
    str | None,
    typer.Argument(metavar="NAME", help="A recording that is there already, as `alarms show` prints it."),
]


def record(name: Name = None, output: Output = None, url: Url = DEFAULT_URL, token: Token = "") -> None:
    """Have a running daemon write the raw frames of the last minutes to a file, as it does around each alarm.

    The file is in `recordings` of its state directory; --output copies it here, for `axiswatch replay`.
    """
    if output is not None:
        check_writable(output)
    with explained(), Client(url, token) as client:
        found = client.record() if name is None else name
        if output is not None:
            write(output, client.recording(found))
    print(f"recorded: {found}" if name is None else found)
    if output is not None:
        print(f"written: {output}")
