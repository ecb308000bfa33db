"""Exit codes and error messages: one message, never a traceback for a user's mistake."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import typer

OK, FAULT, MISTAKE, NO_BUS, UNAVAILABLE = range(5)

EXIT_CODES = """\
Exit codes: 0 done; 1 a fault of the program; 2 a mistake in the command line, in the configuration or in a
file; 3 a bus cannot be opened or written to; 4 the port is taken or the state directory cannot be used."""


@contextmanager
def explained() -> Iterator[None]:
    """Turn the errors that a user can cause into a message and an exit code.

    Raises:
        typer.Exit: after such an error.
    """
    try:
        yield
    except typer.Exit:
        raise
    except Exception as error:
        code = _code(error)
        if code is None:
            raise
        print(f"axiswatch: {error}", file=sys.stderr)
        raise typer.Exit(code) from None


def _code(error: Exception) -> int | None:
    # Imported here: what was not loaded yet has raised nothing, and a command starts without it.
    from monitor_core.calibration import CalibrationError
    from monitor_core.identification import IdentificationError
    from monitor_core.modeling import ModelError
    from service.can.dbc import DbcError
    from service.can.user_errors import BusError, IngestError
    from service.commands.daemon import DaemonFailedError
    from service.config.axis_settings import AxisError
    from service.simulation.robot import FaultError
    from service.store.database import StoreError
    from service.web.server import CannotListenError

    codes: list[tuple[tuple[type[Exception], ...], int]] = [
        ((BusError,), NO_BUS),
        (
            (IngestError, DbcError, AxisError, FaultError, ModelError, IdentificationError, CalibrationError),
            MISTAKE,
        ),
        ((StoreError, CannotListenError), UNAVAILABLE),
        ((DaemonFailedError,), FAULT),
    ]
    return next((code for kinds, code in codes if isinstance(error, kinds)), None)


# --- Commands that run until Ctrl-C or SIGTERM, which is a regular end: exit code 0 -----------------------------------


def stop_on_signals() -> threading.Event:
    """An event that SIGINT and SIGTERM set; the second one ends the process at once."""
    stop = threading.Event()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        stop.set()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    return stop
