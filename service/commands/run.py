"""``axiswatch run``: the daemon."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated

import structlog
import typer

from service.commands.daemon_logs import LogFormat, configure_logs
from service.commands.exit_codes import explained
from service.commands.options import ConfigPath, Port, configuration
from service.config import ConfigErrors, load

Record = Annotated[
    Path | None,
    typer.Option(
        "--record", metavar="FILE", help="Also write the frames as received into this new .log file."
    ),
]


Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        help="Listen on another address than 127.0.0.1 even without tokens or TLS, in a network that you trust.",
    ),
]

LogFormatOption = Annotated[
    LogFormat,
    typer.Option(
        "--log-format",
        help="Lines for people (console), or a JSON object each. auto: console on a terminal, else JSON.",
    ),
]

log = structlog.get_logger(__name__)


def run(
    config: ConfigPath,
    record: Record = None,
    port: Port = None,
    insecure: Insecure = False,
    log_format: LogFormatOption = "auto",
) -> None:
    """Monitor the axes of a configuration until SIGTERM or Ctrl-C: the daemon.

    Alarms and checkpoints are kept in the state directory; the page, the REST interface and the metrics are
    served at the configured address, and so is the report that `commission` has left beside the configuration. A bus
    that goes down later is waited for. Any other address than 127.0.0.1 needs tokens (`axiswatch token`) and TLS.
    SIGHUP checks the configuration file; a new one is used after a restart.
    """
    read = configuration(config)
    from service.commands.daemon import run_daemon

    if port is not None:
        read = read.model_copy(update={"web": read.web.model_copy(update={"port": port})})
    configure_logs(log_format)
    with explained(), _hangup_looks_at(config):
        run_daemon(read, record, reports=config.parent, insecure=insecure)


@contextmanager
def _hangup_looks_at(config: Path) -> Iterator[None]:
    """On SIGHUP log whether the configuration file is right; in a thread, as it takes a while."""

    def look() -> None:
        try:
            load(config)
        except ConfigErrors as errors:
            problems = [str(problem) for problem in errors.problems]
            log.error("SIGHUP: the configuration has mistakes; the daemon goes on", problems=problems)
        else:
            log.warning("SIGHUP: the configuration is right; it is used after a restart", file=str(config))

    def on_hangup(_number: int, _frame: FrameType | None) -> None:
        threading.Thread(target=look, name="configuration", daemon=True).start()

    before = signal.signal(signal.SIGHUP, on_hangup)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)
