"""What the commands of a running daemon share: their options, and how they print its answers."""

import json
from collections.abc import Iterable
from typing import Annotated, Any

import typer

DEFAULT_URL = "http://127.0.0.1:8080"
Url = Annotated[
    str, typer.Option("--url", envvar="AXISWATCH_URL", metavar="URL", help="Address of the daemon.")
]
Token = Annotated[
    str,
    typer.Option(
        "--token",
        envvar="AXISWATCH_TOKEN",
        metavar="TOKEN",
        help="Token of the daemon; better in the environment, as other users can see the words of a command.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the answer of the API as JSON.")]
Comment = Annotated[
    str, typer.Option("--comment", metavar="TEXT", help="For the journal.", show_default=False)
]
WorkOrder = Annotated[
    str, typer.Option("--work-order", metavar="NUMBER", help="In the plant's system.", show_default=False)
]


def print_answer(found: Any, as_json: bool, lines: Iterable[str]) -> None:
    """Print an answer of the API as JSON, or these lines about it."""
    if as_json:
        print(json.dumps(found, indent=1, ensure_ascii=False))
    else:
        for line in lines:
            print(line)


def short_time(iso: str | None) -> str:
    """A time of the API for people; empty: there is none."""
    return "" if iso is None else f"{iso[:10]} {iso[11:19]} UTC"
