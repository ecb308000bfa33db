"""``axiswatch simulate``: a simulated robot sends on the buses of a configuration."""

from collections.abc import Mapping
from typing import Annotated

import typer
from rich.console import Console

from monitor_core.drive import DELAY
from service.can.bus import open_buses
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import (
    ConfigPath,
    Seconds,
    SendYes,
    axis_named,
    configuration,
    confirm_sending,
)
from service.commands.command_line.signal_handling import stopped_by_signals
from service.simulation.robot import SimulatedFault, SimulatedRobot, run_robot, sender

Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of motion and noise, to repeat a run.")]

FaultOption = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar="PARAMETER=FACTOR",
        help="A parameter and the factor by which it changes: fm=1.3, 1/Ja=0.8; or delay=0.0005, by which"
        " the torque acts later [s]. May be repeated.",
    ),
]
FaultAxis = Annotated[
    str | None,
    typer.Option("--fault-axis", metavar="AXIS", help="The axis with the fault: its name, or robot.axis."),
]
FaultAfter = Annotated[
    float,
    typer.Option("--fault-after", min=0.0, metavar="SECONDS", help="Time from the first motion to the fault."),
]


def factors(options: list[str]) -> dict[str, float]:
    """Parse ["fm=1.3"] to {"fm": 1.3}."""
    found = {}
    for text in options:
        name, _, factor = text.partition("=")
        try:
            found[name.strip()] = float(factor)
        except ValueError:
            raise typer.BadParameter(f"{text!r}: must be PARAMETER=FACTOR, e.g. fm=1.3", param_hint="--fault") from None
    return found


def in_words(changes: Mapping[str, float]) -> str:
    """The fault in words: fm x 1.3."""
    parts = (f"torque {1000 * v:g} ms late" if k == DELAY else f"{k} x {v:g}" for k, v in changes.items())
    return ", ".join(parts)


def simulate(
    config: ConfigPath,
    fault: FaultOption = None,
    fault_axis: FaultAxis = None,
    fault_after: FaultAfter = 60.0,
    seconds: Seconds = None,
    seed: Seed = None,
    yes: SendYes = False,
) -> None:
    """Send torque and motion of a simulated robot on the buses of a configuration, until Ctrl-C.

    Its axes are the configured ones; they are healthy until --fault occurs. Start `axiswatch run` with the same
    configuration to monitor it. `axiswatch demo` does both in one process. On a real CAN interface it asks first.
    """
    read = configuration(config)
    faults = []
    if fault:
        where = read.axes[0] if fault_axis is None else axis_named(read.axes, fault_axis, "--fault-axis")
        faults.append(SimulatedFault(where.id, factors(fault), fault_after))
    console = Console(highlight=False, soft_wrap=True)
    with explained(), stopped_by_signals() as stop:
        robot = SimulatedRobot(read, seed, faults)

        def happened(fault: SimulatedFault) -> None:
            console.print(f"{fault.axis_id}: {in_words(fault.factors)}")

        confirm_sending(read.bus, yes)
        with open_buses(read.bus) as buses:
            channels = ", ".join(bus.channel for bus in read.bus)
            console.print(f"{len(read.axes)} axes on {channels}; Ctrl-C ends")
            sent = run_robot(robot, sender(read, buses), stop, happened, seconds)
    console.print(f"{sent.frames} frames sent")
    if sent.left_out:
        console.print(f"{sent.left_out} samples of each axis were left out: this machine is too busy")
