"""CAN logs of the tables of other tests: a DBC of one message for each axis, and frames by it."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np

from service.config import load
from service.ingest.samples.encode import FrameEncoder

_AXIS = """
BO_ {number} Joint{n}: 8 Controller
 SG_ Joint{n}_Torque_Act : 0|24@1- (1E-005,0) [-83|83] "Nm" Monitor
 SG_ Joint{n}_Pos_Act : 24|40@1- (1E-006,0) [-549755|549755] "{unit}" Monitor
"""
_CONFIG_AXIS = """
[[robot.axis]]
name = "a{n}"
bus = "can0"
sample_interval_s = 0.005
torque = {{ message = "Joint{n}", signal = "Joint{n}_Torque_Act" }}
angle = {{ message = "Joint{n}", signal = "Joint{n}_Pos_Act" }}
estimator = {{ torque_noise = 1.0, output_noise = 1.0 }}
model = {{ drive = "two-mass", monitor = ["kT", "fm"], nominal = {{ kT = 1, r = 0.0085 }} }}
"""


def dbc(path: Path, axes: int = 1, unit: str = "deg", more: str = "") -> Path:
    """A message with torque and angle of each axis."""
    text = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: Controller Monitor\n'
    text += "".join(_AXIS.format(number=0x181 + n, n=n + 1, unit=unit) for n in range(axes)) + more
    path.write_text(text, encoding="utf-8")
    return path


def configured(path: Path, file: Path, axes: int = 1) -> Path:
    """A configuration of these axes; their torques and angles as they are in the DBC."""
    bus = f'[[bus]]\nname = "can0"\nchannel = "can0"\nmessages = "{file.name}"\n'
    robot = '[[robot]]\nname = "cell"\n' + "".join(_CONFIG_AXIS.format(n=n + 1) for n in range(axes))
    path.write_text(bus + robot, encoding="utf-8")
    return path


def log_of(table: Path, config: Path, path: Path, factor: float = 1.0) -> Path:
    """A log of the frames with the rows of a table: time, torque and angle of each axis, the latter times a factor."""
    read = load(config, {})
    encoder = FrameEncoder(read, "can0")
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    with can.Logger(str(path)) as writer:
        for count, (t, *values) in enumerate(rows.tolist()):
            of_axes = {axis.id: (values[2 * n], factor * values[2 * n + 1]) for n, axis in enumerate(read.axes)}
            for frame in encoder.encode(of_axes, count):
                channel = "can0" if path.suffix == ".log" else 0
                identifier, extended = frame.key
                writer.on_message_received(can.Message(t, identifier, extended, channel=channel, data=frame.data))
    return path
