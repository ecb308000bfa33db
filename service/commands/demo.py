"""``axiswatch demo``: a simulated robot with a fault, and the daemon that monitors it, in one process."""

import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import structlog
import typer
from rich.console import Console

from service.can.bus import open_buses
from service.commands.calibrate import Budget
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import Port, axis_named, configuration
from service.commands.command_line.output_files import write
from service.commands.command_line.progress import progress_bar
from service.commands.commission import CONFIG
from service.commands.commission import commission as commission_records
from service.commands.daemon.daemon_logs import configure_logs
from service.commands.init import init
from service.commands.simulate import FaultAfter, FaultAxis, FaultOption, factors, in_words
from service.config import Config
from service.config.drive_sources import shipped
from service.config.schema import WebConfig
from service.config.written.commissioned import connected, relocated
from service.simulation.robot import SimulatedFault, SimulatedRobot, run_robot, sender, table_lines

log = structlog.get_logger(__name__)

_MOST_AXES = 6
_LATEST_S, _CATCH_UP = 60.0, 0.25
"""Longest delay of sent samples [s], and their smallest distance in intervals. Their times are kept, so that a busy
machine lags behind, loses no sample, and catches up."""

_FEW_AXES = 2
"""Default number of axes with --commission; more axes take longer."""
ROBOT, COMMISSIONED = "demo.toml", "demo/axiswatch.toml"
"""The simulated robot, and the same robot as it was when it was commissioned."""
_RECORD_SEED = 1
_PROPOSED = 'name = "robot1"'
"""Name that `init` gives a robot whose name it does not know."""

Axes = Annotated[
    int | None,
    typer.Option(
        "--axes",
        min=1,
        max=_MOST_AXES,
        help=f"Number of axes. [default: {_MOST_AXES}, with --commission {_FEW_AXES}]",
    ),
]
Commission = Annotated[
    bool,
    typer.Option(
        "--commission", help="First record and commission the robot: some minutes of computing for each axis."
    ),
]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="With --commission: folder for what is written.")
]
Minutes = Annotated[
    float, typer.Option("--minutes", min=0.5, max=60.0, help="With --commission: length of the record.")
]


def demo(
    fault: FaultOption = None,
    fault_axis: FaultAxis = None,
    fault_after: FaultAfter = 60.0,
    axes: Axes = None,
    commission: Commission = False,
    output: Output = Path("demo-robot"),
    minutes: Minutes = 5.0,
    budget: Budget = "1y",
    port: Port = None,
) -> None:
    """Run a simulated robot on a bus inside the process, and the daemon that monitors it.

    After a minute a fault occurs: the friction of the second axis grows by 30 %, unless options choose another
    fault. The robot is commissioned already; --commission shows all steps: a record of the healthy robot, a
    first configuration, nominal values and thresholds, then the daemon with these.
    """
    count = axes or (_FEW_AXES if commission else _MOST_AXES)
    robot = _robot(configuration(shipped(ROBOT)), count)
    broken = robot.axes[min(1, count - 1)]
    if fault_axis is not None:
        broken = axis_named(robot.axes, fault_axis, "--fault-axis")
    wanted = SimulatedFault(broken.id, factors(fault or ["fm=1.3"]), fault_after)
    with explained():  # a fault that cannot be simulated is refused before minutes of work
        SimulatedRobot(robot, faults=[wanted])
    commissioned = shipped(COMMISSIONED)
    if commission:
        commissioned = _commissioned(shipped(ROBOT), robot, output, minutes, budget)
    with tempfile.TemporaryDirectory(prefix="axiswatch-demo-") as state_dir:
        monitored = _monitored(configuration(commissioned), robot, port, Path(state_dir))
        _run(monitored, commissioned, robot, wanted)


def _robot(config: Config, axes: int) -> Config:
    """The simulated robot with its first axes only."""
    robot = config.robot[0].model_copy(update={"axis": config.robot[0].axis[:axes]})
    # The robot shares this process with the daemon, so the bus keeps the scheduled send times.
    bus = config.bus[0].model_copy(update={"options": {"preserve_timestamps": True}})
    return config.model_copy(update={"bus": (bus,), "robot": (robot,)})


def _monitored(commissioned: Config, robot: Config, port: int | None, state_dir: Path) -> Config:
    """Configuration of the daemon: the commissioned axes among those of the robot."""
    names = {axis.config.name for axis in robot.axes}
    (own,) = commissioned.robot
    axes = tuple(axis for axis in own.axis if axis.name in names)
    own_port = commissioned.web.port if port is None else port
    web = WebConfig(host="127.0.0.1", port=own_port)  # whatever the environment says: it has no tokens
    return commissioned.model_copy(
        update={
            "bus": robot.bus,
            "robot": (own.model_copy(update={"axis": axes}),),
            "service": commissioned.service.model_copy(update={"state_dir": state_dir}),
            "web": web,
        }
    )


def _run(config: Config, file: Path, moved: Config, fault: SimulatedFault) -> None:
    """Run the daemon with ``config``, read from ``file``; the robot ``moved`` starts when its bus is being read.

    An error in one of them ends both.
    """
    from service.commands.daemon.lifecycle import StartEvents, run_daemon

    configure_logs()
    ready, stop, detecting = threading.Event(), threading.Event(), threading.Event()
    with explained(), ThreadPoolExecutor(1, "robot") as pool:
        # At a first start the fault would otherwise begin before its detector is compiled.
        robot = SimulatedRobot(moved, faults=[fault], may_break=detecting.is_set)
        monitored = ", ".join(config.axes[0].config.model.monitor)
        moving = pool.submit(_move, robot, moved, ready, stop)

        def served(url: str) -> None:
            _print_welcome(url, fault, monitored)
            ready.set()

        try:
            run_daemon(config, file, stop=stop, events=StartEvents(served, detecting.set))
        finally:
            stop.set()
            ready.set()
        moving.result()


def _move(robot: SimulatedRobot, config: Config, ready: threading.Event, stop: threading.Event) -> None:
    def happened(fault: SimulatedFault) -> None:
        log.info("the fault begins", axis=fault.axis_id, factors=dict(fault.factors))

    ready.wait()
    try:
        with open_buses(config.bus) as buses:
            sending = sender(config, buses)
            sent = run_robot(robot, sending, stop, happened, latest_s=_LATEST_S, catch_up=_CATCH_UP)
    finally:
        stop.set()
    if sent.left_out:
        log.warning("this machine is too busy: the simulated robot left out samples", samples=sent.left_out)


def _print_welcome(url: str, fault: SimulatedFault, monitored: str) -> None:
    console = Console(highlight=False, soft_wrap=True)
    console.print(f"[bold]dashboard: {url}[/]   (API: {url}docs, metrics: {url}metrics)")
    console.print(f"monitored: {monitored}")
    console.print(
        f"{fault.axis_id}: {in_words(fault.factors)} after {fault.after_s:g} s. At the first start the kernel is "
        "compiled; its samples wait for that, and so does the fault.  Ctrl-C ends the demo."
    )


# --- The way from a robot to its monitor: each step is the one of the command that a user would take ------------------


def _commissioned(source: Path, robot: Config, folder: Path, minutes: float, budget: str) -> Path:
    """Record, describe, commission and connect the simulated robot; returns the configuration for ``run``.

    ``source``: path of its configuration; ``robot``: the configuration itself with the selected axes.

    Raises:
        typer.Exit: an axis could not be commissioned; the report in the folder says why.
    """
    console = Console(highlight=False, soft_wrap=True)
    record, first, made = folder / "healthy.csv", folder / "axis.toml", folder / CONFIG
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"{folder}: {error.strerror}", param_hint="--output") from None

    console.print(f"[bold]1. Record[/] {minutes:g} minutes of the healthy robot: {record}")
    with progress_bar(record.name) as progress:
        write(record, "".join(table_lines(robot, 60 * minutes, _RECORD_SEED, progress)))

    console.print(f"[bold]2. Describe it[/]: axiswatch init {record} --output {first}")
    init(record, output=first, force=True)
    name = f'name = "{robot.robot[0].name}"'
    write(first, first.read_text(encoding="utf-8").replace(_PROPOSED, name))

    console.print(
        f"[bold]3. Commission it[/]: axiswatch commission {record} --config {first} --budget {budget} --output {folder}"
    )
    commission_records(first, [str(record)], folder, budget, yes=True)

    console.print(f"[bold]4. Add the bus[/], and run it: axiswatch run --config {made}")
    signals = relocated(source.read_text(encoding="utf-8"), source.parent, folder.resolve())
    text = connected(made.read_text(encoding="utf-8"), signals, f"The bus and the signals are those of {source.name}.")
    write(made, text)
    return made
