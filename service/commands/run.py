"""``axiswatch run``: the daemon."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import structlog
import typer

from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import ConfigPath, Port, configuration
from service.commands.command_line.signal_handling import handling
from service.commands.daemon.daemon_logs import LogFormat, configure_logs
from service.config import Config, ConfigErrors, load
from service.store.database import StoreError

if TYPE_CHECKING:
    from service.pipeline.reconfiguration.reloading import Reloading

Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Also write the frames as received into this new .log file."),
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
    served at the configured address, and so is the report that `commission` has left beside the configuration. If a
    bus goes down later, the daemon waits. Any other address than 127.0.0.1 needs tokens (`axiswatch token`) and TLS.
    SIGHUP reads the configuration again: changed, new and removed axes, buses and links are applied, the others
    continue. A mistake, or a change that needs a restart, is logged, and nothing is changed.
    """
    hangup = Hangup(config, port)
    # Before anything that takes long: without a handler, SIGHUP ends the process.
    with explained(), handling([signal.SIGHUP], hangup.apply):
        configure_logs(log_format)
        read = configuration(config)
        from service.commands.daemon.lifecycle import StartEvents, run_daemon

        events = StartEvents(reloadable=hangup.start)
        run_daemon(with_port(read, port), config, record, insecure=insecure, events=events)


class Hangup:
    """The action of SIGHUP: read, check and apply the configuration; calls run one after the other.

    Args:
        path: the configuration.
        port: replaces the configured port; None: the configured one.
    """

    def __init__(self, path: Path, port: int | None) -> None:
        self._path, self._port = path, port
        self._lock = threading.Lock()
        self._waits = False
        """Whether SIGHUP came while the daemon was starting, after it had read its configuration"""
        self._reloading: Reloading | None = None
        """None: the daemon has not started yet"""

    def start(self, reloading: Reloading) -> None:
        """The daemon runs; ``reloading`` applies a configuration, now if SIGHUP has come, from another thread."""
        with self._lock:
            self._reloading = reloading
        if self._waits:
            threading.Thread(target=self.apply, name="reload", daemon=True).start()

    def apply(self) -> None:
        """Read and apply the configuration, at once or as soon as the daemon runs.

        A faulty one is logged, shown to the operator, and changes nothing.
        """
        with self._lock:
            if self._reloading is not None:
                self._apply(self._reloading)
                return
            self._waits = True
        log.info("SIGHUP: the configuration is read again once the daemon has started", file=str(self._path))

    def _apply(self, reloading: Reloading) -> None:
        from service.config.public_text import public_problem, public_words
        from service.pipeline.reconfiguration.baselines import BaselineError
        from service.pipeline.reconfiguration.reloading import ReloadError

        try:
            read = with_port(load(self._path), self._port)
        except ConfigErrors as errors:
            problems = [str(problem) for problem in errors.problems]
            log.error("SIGHUP: the configuration has mistakes; nothing was changed", problems=problems)
            reloading.refuse(self._path, [*map(public_problem, errors.problems)])
            return
        try:
            found = reloading.reload(read)
        except (ReloadError, BaselineError, StoreError) as error:
            log.error("SIGHUP: nothing was changed", file=str(self._path), reason=str(error))
            reloading.refuse(self._path, [public_words(error.args[0], self._path.absolute().parent)])
            return
        log.info("SIGHUP: the configuration is used", file=str(self._path), **found._asdict())


def with_port(config: Config, port: int | None) -> Config:
    """The configuration, with the port of the command line if there is one."""
    if port is None:
        return config
    return config.model_copy(update={"web": config.web.model_copy(update={"port": port})})
