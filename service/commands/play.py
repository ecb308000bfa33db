"""``axiswatch play``: send a record on the buses of a configuration."""

import math
import threading
from pathlib import Path
from typing import Annotated

import typer

from service.commands.exit_codes import explained
from service.commands.options import LOG_KINDS, ConfigPath, configuration
from service.commands.progress import progress_bar
from service.commands.sending import SendYes, confirm_sending
from service.commands.signal_handling import stopped_by_signals
from service.config import Config

RecordPath = Annotated[
    Path, typer.Argument(metavar="RECORD", help=f"Table (.csv .parquet .mat) or CAN log ({LOG_KINDS}).")
]
Speed = Annotated[
    float,
    typer.Option(
        "--speed", metavar="FACTOR", help="2 is twice as fast, 0 as fast as the bus accepts frames."
    ),
]

LATE_S = 0.25
TOO_SLOW = "this machine cannot keep up with the record, so the timing on the bus is wrong"


def play(config: ConfigPath, record: RecordPath, speed: Speed = 1.0, yes: SendYes = False) -> None:
    """Send a record on the buses of a configuration, with its recorded timing.

    A CAN log is sent unchanged; a table is encoded by the messages of the bus, from the columns that the configuration
    names. The daemon uses the receipt times of the frames: any speed other than 1 shows it another motion than that of
    the robot, and serves to test the connection only. To evaluate a record fast, use `replay`. On a real CAN interface
    it asks first.
    """
    if not (math.isfinite(speed) and speed >= 0):
        raise typer.BadParameter("must be 0 or greater", param_hint="--speed")
    read = configuration(config)
    with explained(), stopped_by_signals() as stop:
        confirm_sending(read.bus, yes)
        sent, late_s = _play(read, record, speed or math.inf, stop)
    print(f"{sent} frames sent" + (f", some {late_s:.1f} s late: {TOO_SLOW}" if late_s > LATE_S else ""))


def _play(config: Config, path: Path, speed: float, stop: threading.Event) -> tuple[int, float]:
    """Number of frames sent, and the largest delay [s]."""
    from service.can.bus import open_buses
    from service.can.left_out import left_out_words
    from service.ingest.records import read_record
    from service.simulation.playback import play_frames, play_record

    sent, late_s = 0, 0.0
    record = read_record(path, config)
    frames = play_record(record, config)  # its errors are reported before a bus is opened
    with open_buses(config.bus) as buses, progress_bar(path.name) as progress:
        for frame in play_frames(buses, frames, speed, stop):
            sent += 1
            late_s = max(late_s, frame.late_s if speed < math.inf else 0.0)
            progress(frame.done)
    if record.left_out:
        print(left_out_words(path, record.left_out))
    return sent, late_s
