"""``axiswatch demo``: a simulated robot with a fault, and the daemon that monitors it, in one process."""

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from service.commands.exit_codes import explained
from service.commands.options import Port, axis_named, configuration
from service.commands.run import configure_logs
from service.commands.simulate import FaultAfter, FaultAxis, FaultOption, factors, in_words
from service.config import Config
from service.config.drive_sources import shipped
from service.simulation.demonstration import usual_fault, watching, with_drive
from service.simulation.robot import Fault, RobotThread

_MOST_AXES = 6

Axes = Annotated[int, typer.Option("--axes", min=1, max=_MOST_AXES, help="Number of axes.")]
StateDir = Annotated[
    Path | None,
    typer.Option(
        "--state-dir", metavar="DIR", help="Keep alarms and checkpoints here. [default: a temporary one]"
    ),
]


DriveOption = Annotated[
    str | None,
    typer.Option(
        "--drive",
        metavar="FILE.mo|NAME",
        help="Axes with this drive: a Modelica file with its values, or two-mass, three-mass, five-mass.",
    ),
]
ModelOption = Annotated[
    str | None, typer.Option("--model", metavar="NAME", help="Which model of the Modelica file.")
]
MonitorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--monitor",
        metavar="PARAMETER",
        help="Parameter to monitor: kT, 1/Ja. May be repeated. [default: up to three distinguishable ones]",
    ),
]


def demo(
    fault: FaultOption = None,
    fault_axis: FaultAxis = None,
    fault_after: FaultAfter = 60.0,
    drive: DriveOption = None,
    model: ModelOption = None,
    monitor: MonitorOption = None,
    axes: Axes = _MOST_AXES,
    port: Port = None,
    state_dir: StateDir = None,
) -> None:
    """Look around: a simulated robot on a bus inside the process, and the daemon that monitors it.

    After a minute a fault occurs: the friction of the second axis grows by 30 %, unless options choose another
    fault. With another drive the torque constant, the last inertia and the friction are monitored, where it has them.
    """
    with _folder(state_dir) as folder:
        read = _adapted(configuration(shipped("demo.toml")), axes, port, folder)
        with explained():
            read = with_drive_of(read, drive, model, tuple(monitor or ()))
        broken = read.axes[min(1, axes - 1)]
        if fault_axis is not None:
            broken = axis_named(read.axes, fault_axis, "--fault-axis")
        breaks = fault or [f"{usual_fault(read.axes[0].config)}=1.3"]
        _run(read, Fault(broken.id, factors(breaks), fault_after))


@contextmanager
def _folder(given: Path | None) -> Iterator[Path]:
    if given is not None:
        yield given
        return
    with tempfile.TemporaryDirectory(prefix="axiswatch-demo-") as folder:
        yield Path(folder)


def _adapted(config: Config, axes: int, port: int | None, state_dir: Path) -> Config:
    robot = config.robot[0].model_copy(update={"axis": config.robot[0].axis[:axes]})
    return config.model_copy(
        update={
            "robot": (robot,),
            "service": config.service.model_copy(update={"state_dir": state_dir}),
            "web": config.web if port is None else config.web.model_copy(update={"port": port}),
        }
    )


def with_drive_of(config: Config, drive: str | None, model: str | None, monitor: tuple[str, ...]) -> Config:
    """The configuration with this drive and these monitored parameters for every axis."""
    axis = config.robot[0].axis[0]
    if drive is not None:
        axis = with_drive(axis, drive, model, monitor)
    elif model is not None:
        raise typer.BadParameter("is a model of a file: give it with --drive FILE.mo", param_hint="--model")
    try:
        axis = watching(axis, monitor) if monitor else axis
    except (KeyError, ValueError) as error:
        raise typer.BadParameter(str(error.args[0]), param_hint="--monitor") from None
    changed = {"model": axis.model, "estimator": axis.estimator}
    axes = tuple(
        each.model_copy(
            update={**changed, "torque": each.torque.model_copy(update={"factor": axis.torque.factor})}
        )
        for each in config.robot[0].axis
    )
    return config.model_copy(update={"robot": (config.robot[0].model_copy(update={"axis": axes}),)})


def _run(config: Config, fault: Fault) -> None:
    from service.commands.daemon import run_daemon

    configure_logs()
    stop = threading.Event()
    with explained():
        robot = RobotThread(config, fault, stop)
        monitored = ", ".join(config.axes[0].config.model.monitor)
        run_daemon(
            config, ready=lambda url: _print_welcome(url, fault, monitored), stop=stop, keeping_up=robot.start
        )
        robot.join()


def _print_welcome(url: str, fault: Fault, monitored: str) -> None:
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"[bold]dashboard: {url}[/]   (API: {url}docs, metrics: {url}metrics)")
    console.print(f"monitored: {monitored}")
    console.print(
        f"{fault.axis_id}: {in_words(fault.factors)} after {fault.after_s:g} s of motion. The motion begins when the "
        "kernel is compiled, which takes some seconds at the first start.  Ctrl-C ends the demo."
    )
