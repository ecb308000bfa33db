"""``axiswatch play``: send a record on the buses of a configuration."""

import math
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from service.can.bus import Bus, open_buses, send
from service.can.frames import FrameKey
from service.can.user_errors import IngestError, RecordError, left_out_words
from service.commands.command_line.exit_codes import explained
from service.commands.command_line.options import LOG_KINDS, ConfigPath, SendYes, configuration, confirm_sending
from service.commands.command_line.progress import progress_bar
from service.commands.command_line.signal_handling import stopped_by_signals
from service.config import Config
from service.ingest.records.record_files import FileRecord, LogRecord, RecordStep, read_record
from service.ingest.samples.encode import FrameEncoder, SampleValues

RecordPath = Annotated[
    Path, typer.Argument(metavar="RECORD", help=f"Table (.csv .parquet .mat) or CAN log ({LOG_KINDS}).")
]
Speed = Annotated[
    float,
    typer.Option("--speed", metavar="FACTOR", help="2 is twice as fast, 0 as fast as the bus accepts frames."),
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


# --- Records as frames, in time ---------------------------------------------------------------------------------------


_NAP_S = 0.05


class PlayFrame(NamedTuple):
    """A frame and its time of sending after the first one."""

    offset_s: float
    bus: str
    key: FrameKey
    data: bytes
    done: float  # how much of the record has been read, 0 to 1
    late_s: float = 0.0  # how much later than it should it was sent


def play_record(record: FileRecord, config: Config) -> Iterator[PlayFrame]:
    """The frames of a record: those of a CAN log unchanged, rows of a table encoded with the messages of the bus.

    Raises:
        RecordError: the record is damaged, or a value does not fit into its signal.
        DescriptionError, IngestError: the configuration cannot be used.
    """
    return _log_frames(record) if isinstance(record, LogRecord) else encode_table(record, config)


def encode_table(record: FileRecord, config: Config) -> Iterator[PlayFrame]:
    """The frames that carry the samples of a record; sample counters follow the time."""
    encoders = {bus.name: FrameEncoder(config, bus.name) for bus in config.bus}
    interval_us = min(axis.config.sample_interval_s for axis in config.axes) * 1e6
    first_us: int | None = None
    for step in record.steps():
        for t_us, values in _by_time(step):
            first_us = t_us if first_us is None else first_us
            count = round((t_us - first_us) / interval_us)
            for bus, encoder in encoders.items():
                try:
                    frames = encoder.encode(values, count)
                except IngestError as error:
                    raise RecordError(f"{record.path}, at {t_us / 1e6:.6f} s: {error}") from None
                for key, data in frames:
                    yield PlayFrame((t_us - first_us) / 1e6, bus, key, data, step.done)


def play_frames(
    buses: Mapping[str, Bus],
    frames: Iterable[PlayFrame],
    speed: float = 1.0,
    stop: threading.Event | None = None,
) -> Iterator[PlayFrame]:
    """Send frames on a schedule that does not drift; yields each after it has been sent.

    Args:
        buses: open buses by name.
        frames: the frames to send, in order of time.
        speed: 2.0 is twice as fast; inf is as fast as the bus accepts them.
        stop: ends it early, when set.
    """
    stop = stop or threading.Event()
    start = time.monotonic()
    for frame in frames:
        due = start + frame.offset_s / speed
        _wait(due - time.monotonic(), stop)
        if stop.is_set():
            return
        send(buses[frame.bus], frame.key, frame.data)
        yield frame._replace(late_s=time.monotonic() - due)


def _wait(wait_s: float, stop: threading.Event) -> None:
    if wait_s > _NAP_S:
        stop.wait(wait_s)
    elif wait_s > 0:
        time.sleep(wait_s)  # a fifth of the work of an Event: matters at 2000 frames a second


def _by_time(step: RecordStep) -> Iterator[tuple[int, dict[str, SampleValues]]]:
    """The samples of all axes in order of time; samples of the same time together."""
    rows: dict[int, dict[str, SampleValues]] = {}
    for axis_id, block in step.samples.items():
        signals = np.zeros((len(block.t_us), 0)) if block.signals is None else block.signals
        columns = (block.t_us, block.u, block.y, signals)
        for t_us, torque, motion, further in zip(*(c.tolist() for c in columns), strict=True):
            rows.setdefault(t_us, {})[axis_id] = (torque, motion, tuple(further))
    return iter(sorted(rows.items(), key=lambda row: row[0]))


def _log_frames(record: LogRecord) -> Iterator[PlayFrame]:
    first_us: int | None = None
    for of_bus, done in record.frames():
        frames = [(frame, bus) for bus, block in of_bus.items() for frame in block.frames()]
        for frame, bus in sorted(frames, key=lambda entry: entry[0].t_us):
            first_us = frame.t_us if first_us is None else first_us
            yield PlayFrame((frame.t_us - first_us) / 1e6, bus, frame.key, frame.data, done)
