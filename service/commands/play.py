"""``axiswatch play``: a record onto the buses of a configuration."""

import math
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from service.commands.configuration import ConfigPath, configuration
from service.commands.exits import explained
from service.commands.progress import progress_bar
from service.commands.stopping import stop_on_signals
from service.config import Config

RecordPath = Annotated[
    Path,
    typer.Argument(metavar="RECORD", help="Table (.csv .parquet .mat) or CAN log (.log .asc .blf .trc)."),
]
Speed = Annotated[
    float,
    typer.Option("--speed", metavar="FACTOR", help="2 is twice as fast, 0 as fast as the bus takes it."),
]
Loop = Annotated[bool, typer.Option("--loop", help="Begin again at the end, until Ctrl-C.")]

LATE_S = 0.25
TOO_SLOW = "this machine cannot keep up with the record, and its times are wrong on the bus"


def play(config: ConfigPath, record: RecordPath, speed: Speed = 1.0, loop: Loop = False) -> None:
    """Send a record on the buses of a configuration, at the speed of its own times.

    A CAN log is sent as it is; a table goes through the DBC, by the columns that the configuration names. The daemon
    goes by the times at which it receives frames: another speed than 1 shows it other motions than the robot made, so
    it is for trying the wiring. To have a record evaluated fast, use `replay`.
    """
    if not (math.isfinite(speed) and speed >= 0):
        raise typer.BadParameter("must be 0 or greater", param_hint="--speed")
    read = configuration(config)
    stop = stop_on_signals()
    with explained():
        sent, late_s = _play(read, record, speed or math.inf, loop, stop)
    print(f"{sent} frames sent" + (f", some {late_s:.1f} s late: {TOO_SLOW}" if late_s > LATE_S else ""))


def _play(config: Config, record: Path, speed: float, loop: bool, stop: threading.Event) -> tuple[int, float]:
    """Frames sent, and by how much one was late."""
    from service.can.bus import open_bus
    from service.simulation.playback import play_frames, play_record

    sent, late_s = 0, 0.0
    play_record(record, config)  # what is wrong with it is said before a bus is opened
    with ExitStack() as stack:
        buses = {bus.name: open_bus(bus, ()) for bus in config.bus}
        for bus in buses.values():
            stack.callback(bus.shutdown)
        while True:
            with progress_bar(record.name) as progress:
                for frame in play_frames(buses, play_record(record, config), speed, stop):
                    sent += 1
                    late_s = max(late_s, frame.late_s if speed < math.inf else 0.0)
                    progress(frame.done)
            if not loop or stop.is_set():
                return sent, late_s
