"""``axiswatch run``: the daemon."""

from pathlib import Path
from typing import Annotated

import typer

from service.commands.configuration import configuration
from service.commands.exit_codes import explained
from service.commands.options import ConfigPath, Port

Record = Annotated[
    Path | None,
    typer.Option(
        "--record", metavar="FILE", help="Also write the frames as received into this new .log file."
    ),
]


def run(config: ConfigPath, record: Record = None, port: Port = None) -> None:
    """Monitor the axes of a configuration until SIGTERM or Ctrl-C: the daemon.

    Alarms and checkpoints are kept in the state directory; the page, the REST interface and the metrics are
    served at the configured address. A bus that goes down later is waited for.
    """
    read = configuration(config)
    from service.commands import logs
    from service.commands.daemon import run_daemon

    if port is not None:
        read = read.model_copy(update={"web": read.web.model_copy(update={"port": port})})
    logs.configure()
    with explained():
        run_daemon(read, record)
