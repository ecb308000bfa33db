"""``axiswatch run``: the daemon; its logs are readable on a terminal, otherwise one JSON object a line."""

import logging
import sys
from pathlib import Path
from typing import Annotated, TextIO

import structlog
import typer
from structlog.typing import Processor

from service.commands.exit_codes import explained
from service.commands.options import ConfigPath, Port, configuration

Record = Annotated[
    Path | None,
    typer.Option(
        "--record", metavar="FILE", help="Also write the frames as received into this new .log file."
    ),
]


def run(config: ConfigPath, record: Record = None, port: Port = None) -> None:
    """Monitor the axes of a configuration until SIGTERM or Ctrl-C: the daemon.

    Alarms and checkpoints are kept in the state directory; the page, the REST interface and the metrics are
    served at the configured address, and so is the report that `commission` has left beside the configuration. A bus
    that goes down later is waited for.
    """
    read = configuration(config)
    from service.commands.daemon import run_daemon

    if port is not None:
        read = read.model_copy(update={"web": read.web.model_copy(update={"port": port})})
    configure_logs()
    with explained():
        run_daemon(read, record, reports=config.parent)


def configure_logs(stream: TextIO | None = None, level: int = logging.INFO) -> None:
    """Send all logs, those of libraries too, to ``stream``, default the standard error stream."""
    target = stream or sys.stderr
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(target)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *_rendering(target)],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    # The daemon itself reports better what these log at INFO.
    for name in ("can", "uvicorn", "asyncio"):
        logging.getLogger(name).setLevel(logging.WARNING)


def _rendering(target: TextIO) -> list[Processor]:
    if target.isatty():
        return [structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)]
    return [structlog.processors.dict_tracebacks, structlog.processors.JSONRenderer()]
