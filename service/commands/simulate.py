"""``axiswatch simulate``: a simulated robot sends on the buses of a configuration."""

from functools import partial
from typing import Annotated

import typer
from rich.console import Console

from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import explained
from service.commands.faults import FaultAfter, FaultAxis, FaultOption, axis_id, factors, in_words
from service.commands.stopping import stop_on_signals
from service.simulation.robot import Fault, SimulatedRobot
from service.simulation.sending import open_buses, run_robot

Seconds = Annotated[
    float | None,
    typer.Option("--seconds", min=0.0, metavar="N", help="Stop after N seconds. [default: never]"),
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of motion and noise, to repeat a run.")]


def simulate(
    config: ConfigPath,
    fault: FaultOption = None,
    fault_axis: FaultAxis = None,
    fault_after: FaultAfter = 60.0,
    seconds: Seconds = None,
    seed: Seed = None,
) -> None:
    """Send torque and motion of a simulated robot on the buses of a configuration, until Ctrl-C.

    Its axes are the configured ones; they are healthy until --fault occurs. Start `axiswatch run` with the same
    configuration to monitor it. `axiswatch demo` does both in one process.
    """
    read = configuration(config)
    known = [axis.id for axis in read.axes]
    faults = []
    if fault:
        where = axis_id(fault_axis, known) if fault_axis else known[0]
        faults.append(Fault(where, factors(fault), fault_after))
    console = Console(highlight=False, soft_wrap=True)
    stop = stop_on_signals()
    with explained():
        robot = SimulatedRobot(read, seed, faults)
        with open_buses(read) as send_moment:
            console.print(f"{len(known)} axes on {', '.join(bus.channel for bus in read.bus)}; Ctrl-C ends")
            frames = run_robot(robot, send_moment, stop, partial(_print_fault, console), seconds)
    console.print(f"{frames} frames sent")


def _print_fault(console: Console, fault: Fault) -> None:
    console.print(f"{fault.axis_id}: {in_words(fault.factors)}")
