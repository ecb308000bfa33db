"""The command line.  Each command is a module of this folder, imported only when it is used."""

import atexit
import gc
import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from monitor_core.wording import did_you_mean
from service.commands.command_line.exit_codes import EPILOG, GROUP
from service.pipeline.kernel_cache import EARLY, KernelShape, choose

PANELS = {
    "A first robot": ("demo", "init", "commission", "run"),
    "Look at the signals": ("check", "listen", "discover"),
    "Commission step by step": ("model", "excite", "identify", "calibrate", "replay"),
    "While the daemon runs": ("status", "alarms", "baseline", "history", "record"),
    "Access and backup": ("token", "backup", "restore"),
    "Send on a bus, for tests": ("simulate", "play"),
    "The program": ("warm", "version"),
}
"""Commands by purpose, in the order of the help."""
COMMANDS = tuple(name for names in PANELS.values() for name in names)
_PANEL = {name: panel for panel, names in PANELS.items() for name in names}

HELP = """Condition monitoring of robot axes: friction, inertia and torque constant from the torque and the angle on the
CAN bus.

From a robot on a bus to its daemon, while it works as usual:

    axiswatch init robot.dbc --bus socketcan:can0

    axiswatch commission --config axis.toml --minutes 10

    axiswatch run --config commissioned/axiswatch.toml
"""
NO_CONFIG = (
    "axiswatch init writes a first one (axis.toml), axiswatch commission the one for run (commissioned/axiswatch.toml)"
)


class _LazyGroup(TyperGroup):
    """Imports the module of a command only when it is used: most of them load large libraries."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 - as in the base class
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            ctx.fail(f"no command {cmd_name!r}: {did_you_mean(cmd_name, COMMANDS)}")
        command = self._command(cmd_name)
        command.rich_help_panel = _PANEL[cmd_name]
        return command

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            # A missing option is a subclass, which typer does not export.
            missing = type(error) is not typer.BadParameter
            if missing and error.param is not None and error.param.name == "config":
                error.message = NO_CONFIG
            # Of pydantic, by which typer checks choices.
            error.message = error.message.removeprefix("Value error, ")
            raise

    def _command(self, cmd_name: str) -> Any:
        command = getattr(import_module(f"service.commands.{cmd_name}"), cmd_name)
        if isinstance(command, typer.Typer):  # it has commands of its own
            group = typer.main.get_command(command)
            group.name = cmd_name
            return group
        typer_app = typer.Typer(add_completion=False, rich_markup_mode="markdown", pretty_exceptions_enable=False)
        typer_app.command(cmd_name, epilog=EPILOG)(command)
        return typer.main.get_command(typer_app)


app = typer.Typer(
    cls=_LazyGroup,
    name="axiswatch",
    help=HELP,
    context_settings={"help_option_names": ["-h", "--help"]},
    **GROUP,
)


def _version(asked: bool) -> None:
    if asked:
        import_module("service.commands.version").version()
        raise typer.Exit


@app.callback()
def _group(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """The program ``axiswatch``."""
    # Library objects stay in memory, and searching them for garbage takes a sixth of the time of a short command.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    # Must be set before numpy is imported: for matrices this small more threads only cost time.
    for library in ("OPENBLAS", "OMP", "MKL", "NUMBA"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    choose(os.environ)
    if sys.argv[1:2] in (["demo"], ["run"]) and {"-h", "--help"}.isdisjoint(sys.argv):
        # At a cold start the compiler starts now instead of after this process has imported its libraries.
        EARLY.begin(KernelShape.FEW_AXES)
    try:
        app()
    except SystemExit as end:
        if sys.argv[1:2] == ["run"] and isinstance(end.code, int):
            # Everything is saved and closed; tearing down the interpreter would delay a stop by seconds on a busy
            # machine.
            atexit._run_exitfuncs()
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError):  # nobody reads it any more
                    stream.flush()
            os._exit(end.code)
        raise


if __name__ == "__main__":
    main()
