"""A bus as a plant might have it, and configurations for it.

Scales are powers of two, so that decoded values are exact.
"""

import itertools
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import scipy.io

from monitor_core.samples import SampleBlock
from service.can.frames import Frame, FrameBlock
from service.config.schema import Config
from service.config.schema.base_table import ReadingContext
from service.ingest.samples.bus_samples import Ingest

START_US = 1_760_000_000_000_000
ANGLE_ID = 0x18FF0100
DBC = """VERSION ""

NS_ :

BS_:

BU_: Drive Monitor

BO_ 256 Torque1: 4 Drive
 SG_ Torque : 0|16@1- (0.0009765625,0) [0|0] "N m" Monitor
 SG_ Count : 16|8@1+ (1,0) [0|0] "" Monitor

BO_ 2566848768 Angle1: 8 Drive
 SG_ Angle : 0|32@1- (1.52587890625E-005,0) [0|0] "rad" Monitor
 SG_ Count : 32|8@1+ (1,0) [0|0] "" Monitor

BO_ 272 Both2: 8 Drive
 SG_ Torque : 0|16@1- (0.0009765625,0) [0|0] "N m" Monitor
 SG_ Speed : 16|32@1- (1.52587890625E-005,0) [0|0] "rad/s" Monitor
 SG_ Count : 48|16@1+ (1,0) [0|0] "" Monitor

BO_ 288 Mux3: 8 Drive
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" Monitor
 SG_ Torque m1 : 8|32@1- (1,0) [0|0] "N m" Monitor
 SG_ Speed m2 : 8|32@1- (1,0) [0|0] "rad/s" Monitor

BO_ 304 Wide4: 64 Drive
 SG_ Torque : 0|32@1- (1,0) [0|0] "N m" Monitor
 SG_ Speed : 480|32@1- (1,0) [0|0] "rad/s" Monitor
 SG_ Mode : 40|8@1+ (1,0) [0|0] "" Monitor

BO_ 320 Other: 8 Drive
 SG_ Something : 0|8@1+ (1,0) [0|0] "" Monitor

BA_DEF_ SG_ "GenSigStartValue" INT 0 255;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenSigStartValue" SG_ 304 Mode 7;

SIG_VALTYPE_ 288 Torque : 1;
SIG_VALTYPE_ 288 Speed : 1;
SIG_VALTYPE_ 304 Torque : 1;
SIG_VALTYPE_ 304 Speed : 1;
VAL_ 272 Torque 0 "idle" 1 "on";
"""

Axis = dict[str, Any]


class Sample(NamedTuple):
    """A row of a block of samples."""

    t_us: int
    torque: float
    motion: float
    signals: tuple[float, ...] = ()


def torque1(t_us: int, torque: float, count: int = 0) -> Frame:
    return Frame(t_us, 0x100, False, struct.pack("<hBx", round(torque * 1024), count % 256))


def angle1(t_us: int, angle: float, count: int = 0) -> Frame:
    return Frame(t_us, ANGLE_ID, True, struct.pack("<iB3x", round(angle * 65536), count % 256))


def both2(t_us: int, torque: float, speed: float, count: int = 0) -> Frame:
    data = struct.pack("<hiH", round(torque * 1024), round(speed * 65536), count % 65536)
    return Frame(t_us, 0x110, False, data)


def rows_of(block: SampleBlock) -> list[Sample]:
    """The samples of a block."""
    signals = block.signals.tolist() if block.signals is not None else [()] * block.size
    columns = (block.t_us.tolist(), block.u.tolist(), block.y.tolist(), map(tuple, signals))
    return [Sample(*row) for row in zip(*columns, strict=True)]


def fed(ingest: Ingest, frames: Sequence[Frame]) -> dict[str, list[Sample]]:
    """The samples that these frames complete."""
    found = ingest.feed(FrameBlock.from_frames(frames))
    return {axis_id: rows_of(block) for axis_id, block in found.items()}


def flushed(ingest: Ingest) -> dict[str, list[Sample]]:
    """The last samples."""
    return {axis_id: rows_of(block) for axis_id, block in ingest.flush().items()}


def axis(name: str, torque: tuple[str, str], motion: tuple[str, str], output: str, **other: Any) -> Axis:
    """An axis of the bus above; torque and motion are (message, signal)."""
    return {
        "name": name,
        "bus": "bus0",
        "sample_interval_s": 0.005,
        "torque": {"message": torque[0], "signal": torque[1], "column": f"torque_{name}"},
        output: {"message": motion[0], "signal": motion[1], "column": f"{output}_{name}"},
        "model": {"monitor": ["kT"], "nominal": {"kT": 1.0}},
        "estimator": {},
        **other,
    }


def axis1(**other: Any) -> Axis:
    """Torque and angle in two messages, one of them with an extended id."""
    return axis("one", ("Torque1", "Torque"), ("Angle1", "Angle"), "angle", **other)


def axis2(**other: Any) -> Axis:
    """Torque and speed in one message."""
    return axis("two", ("Both2", "Torque"), ("Both2", "Speed"), "speed", **other)


def axis3(**other: Any) -> Axis:
    """Torque and speed in one multiplexed message, never both."""
    return axis("three", ("Mux3", "Torque"), ("Mux3", "Speed"), "speed", **other)


def axis4(**other: Any) -> Axis:
    """Torque and speed in one CAN FD message."""
    return axis("four", ("Wide4", "Torque"), ("Wide4", "Speed"), "speed", **other)


def counted(message: str) -> dict[str, str]:
    return {"counter_message": message, "counter_signal": "Count"}


def axis_drops(ingest: Ingest, axis_id: str) -> dict[str, int]:
    return {reason: n for reason, n in ingest.axes[axis_id].dropped.items() if n}


def write_table(path: Path, columns: Mapping[str, Any]) -> Path:
    """A .csv, .parquet or .mat file with these columns."""
    if path.suffix == ".csv":
        pa.csv.write_csv(pa.table(dict(columns)), path)
    elif path.suffix == ".parquet":
        pa.parquet.write_table(pa.table(dict(columns)), path)
    else:
        scipy.io.savemat(path, {name: np.asarray(c) for name, c in columns.items()}, oned_as="column")
    return path


_CHANNELS = itertools.count()


def make_config(folder: Path, *axes: Axis, **bus: Any) -> Config:
    """A configuration in that folder of one bus, "bus0", a virtual one unless said otherwise."""
    (folder / "plant.dbc").write_text(DBC, encoding="utf-8")
    bus0 = {
        "name": "bus0",
        "interface": "virtual",
        "channel": f"ingest-test-{next(_CHANNELS)}",
        "messages": "plant.dbc",
        **bus,
    }
    values = {"bus": [bus0], "robot": [{"name": "r", "axis": list(axes)}]}
    return Config.model_validate(values, context=ReadingContext(folder))
