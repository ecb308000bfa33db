"""Exit codes and error messages: for a mistake of the user one message and no traceback."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

OK, FAULT, MISTAKE, NO_BUS, UNAVAILABLE, NOT_TESTED = range(6)

EXIT_CODES = """\
Exit codes: 0 done; 1 a fault of the program; 2 a mistake in the command line, in the configuration or in a
file, or a fit of identify that is too poor to be used; 3 a bus cannot be opened or written to; 4 the port is
taken, the state directory cannot be used, or the daemon does not answer or is not ready (status, alarms, baseline);
5 replay: a parameter was not tested in the records, so the absence of an alarm says nothing of it; commission: an axis
could not be commissioned."""
EPILOG = " ".join(EXIT_CODES.split())
"""Last lines of the help of each command."""
GROUP: dict[str, Any] = {
    "epilog": EPILOG,
    "no_args_is_help": True,
    "add_completion": False,
    "rich_markup_mode": "markdown",
    "pretty_exceptions_enable": False,
}
"""Settings of every group of commands."""


class DaemonFailedError(Exception):
    """The daemon ended because of an internal fault, which is in the log."""


@contextmanager
def explained(*mistakes: type[Exception]) -> Iterator[None]:
    """Turn errors that a user can cause into a message and an exit code; ``mistakes``: further such errors.

    Raises:
        typer.Exit: after such an error.
    """
    try:
        yield
    except (typer.Exit, typer.BadParameter):
        raise
    except Exception as error:
        code = _code(error, mistakes)
        if code is None:
            raise
        print(f"axiswatch: {error}", file=sys.stderr)
        raise typer.Exit(code) from None


def _code(error: Exception, mistakes: tuple[type[Exception], ...]) -> int | None:
    # Imported here: a module that is not loaded cannot have raised its errors, and commands start faster.
    from monitor_core.calibration import CalibrationError
    from monitor_core.identification import IdentificationError
    from monitor_core.modeling import ModelError
    from service.can.messages import DescriptionError
    from service.can.user_errors import BusError, IngestError
    from service.client import ClientError
    from service.config.axis_settings import AxisError
    from service.links.link_secrets import LinkSecretError
    from service.simulation.robot import FaultError
    from service.store.database import StoreError
    from service.web.access import UnprotectedError
    from service.web.server import CannotListenError, CertificateError

    if isinstance(error, ClientError):
        return MISTAKE if error.refused else UNAVAILABLE
    if isinstance(error, BusError):
        return NO_BUS
    given = (IngestError, DescriptionError, AxisError, FaultError)
    found = (ModelError, IdentificationError, CalibrationError)
    access = (UnprotectedError, CertificateError, LinkSecretError)
    if isinstance(error, (*given, *found, *access, *mistakes)):
        return MISTAKE
    if isinstance(error, StoreError | CannotListenError):
        return UNAVAILABLE
    return FAULT if isinstance(error, DaemonFailedError) else None
