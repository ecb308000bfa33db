"""Options of the commands that ask a running daemon, and the printing of its answers.

They import no module of the daemon itself, so that they start fast.
"""

import json
from collections.abc import Callable, Iterable
from functools import wraps
from inspect import Parameter, signature
from typing import Annotated, Any, get_type_hints

import typer

from service.client import Client, Remark
from service.commands.command_line.exit_codes import explained

DEFAULT_URL = "http://127.0.0.1:8080"
Url = Annotated[str, typer.Option("--url", envvar="AXISWATCH_URL", metavar="URL", help="Address of the daemon.")]
Token = Annotated[
    str,
    typer.Option(
        "--token",
        envvar="AXISWATCH_TOKEN",
        metavar="TOKEN",
        help="Token of the daemon; safer in the environment, as other users can see command lines.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the answer of the API as JSON.")]
Comment = Annotated[str, typer.Option("--comment", metavar="TEXT", help="Comment for the alarm journal.")]
WorkOrder = Annotated[str, typer.Option("--work-order", metavar="NUMBER", help="Number of a work order.")]


class Daemon:
    """The daemon that a command asks, by ``client``, and the format of the output."""

    def __init__(self, client: Client, url: str, as_json: bool) -> None:
        self.client, self.url, self._as_json = client, url, as_json

    def show(self, found: Any, lines: Iterable[str]) -> None:
        """Print an answer of the API as JSON if that was requested, else these lines."""
        if self._as_json:
            print(json.dumps(found, indent=1, ensure_ascii=False))
        else:
            for line in lines:
                print(line)


_REMARK: dict[str, tuple[Any, Any]] = {"comment": (Comment, ""), "work_order": (WorkOrder, "")}
_DAEMON: dict[str, tuple[Any, Any]] = {
    "url": (Url, DEFAULT_URL), "token": (Token, ""), "as_json": (AsJson, False)
}  # fmt: skip
"""Name of each option, its type and its default"""


def asks_daemon(command: Callable[..., None]) -> Callable[..., None]:
    """Turn a function whose first argument is the Daemon into a command with the options --url, --token and --json.

    An argument ``remark`` stands for --comment and --work-order.
    """
    types = get_type_hints(command, include_extras=True)
    own = [p for name, p in signature(command).parameters.items() if name not in ("daemon", "remark")]
    remarks = _REMARK if "remark" in types else {}
    parameters = [p.replace(annotation=types[p.name], kind=Parameter.KEYWORD_ONLY) for p in own]
    for name, (kind, default) in (remarks | _DAEMON).items():
        parameters.append(Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind))

    @wraps(command)
    def run(url: str, token: str, as_json: bool, **given: Any) -> None:
        if remarks:
            given["remark"] = Remark(**{name: given.pop(name) for name in remarks})
        with explained(), Client(url, token) as client:
            command(Daemon(client, url, as_json), **given)

    vars(run)["__signature__"] = signature(command).replace(parameters=parameters)
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


def short_time(iso: str | None) -> str:
    """A time of the API in readable form; empty: no time."""
    return "" if iso is None else f"{iso[:10]} {iso[11:19]} UTC"
