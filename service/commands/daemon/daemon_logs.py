"""Logs of the daemon: lines for people, or one JSON object a line; in the journal of systemd with their priorities."""

import logging
import os
import sys
from collections.abc import Mapping
from typing import Literal, TextIO

import structlog
from structlog.typing import EventDict, Processor, WrappedLogger

LogFormat = Literal["auto", "console", "json"]

_PRIORITIES = {"debug": 7, "info": 6, "warning": 4, "warn": 4, "error": 3, "exception": 3, "critical": 2}
"""Priorities of syslog, as in sd-daemon(3), by method of the logger"""


def configure_logs(
    log_format: LogFormat = "auto", stream: TextIO | None = None, environ: Mapping[str, str] = os.environ
) -> None:
    """Send all logs, including those of libraries, to a stream.

    Args:
        log_format: auto is console on a terminal, else JSON.
        stream: default the standard error stream.
        environ: with JOURNAL_STREAM, if systemd has connected the stream to its journal.
    """
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
    rendering = _rendering(log_format, target)
    if _is_journal(target, environ):
        rendering.append(_with_priority)
    handler = logging.StreamHandler(target)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *rendering],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.INFO)
    # The daemon's own reports replace the INFO messages of these libraries; httpx logs whole addresses, and those of
    # webhooks are secret.
    for name in ("can", "uvicorn", "asyncio", "httpx", "httpcore"):
        logging.getLogger(name).setLevel(logging.WARNING)


def _rendering(log_format: LogFormat, target: TextIO) -> list[Processor]:
    terminal = target.isatty()
    if log_format == "console" or (log_format == "auto" and terminal):
        plain = structlog.dev.plain_traceback
        return [structlog.dev.ConsoleRenderer(colors=terminal, exception_formatter=plain)]
    # Without local variables: those of a request contain its token.
    traceback = structlog.tracebacks.ExceptionDictTransformer(show_locals=False)
    return [structlog.processors.ExceptionRenderer(traceback), structlog.processors.JSONRenderer()]


def _is_journal(target: TextIO, environ: Mapping[str, str]) -> bool:
    """Whether systemd's journal reads the stream directly; it may have been redirected since the start."""
    try:
        status = os.fstat(target.fileno())
    except (OSError, ValueError):  # it is no file
        return False
    return environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def _with_priority(_logger: WrappedLogger, method: str, rendered: EventDict | str) -> str:
    """Put the priority before each line; the journal stores it and removes it from the text."""
    prefix = f"<{_PRIORITIES.get(method, 6)}>"
    return "\n".join(prefix + line for line in str(rendered).splitlines())
