"""A robot of many axes that fills its bus: its configuration and its frames."""

from pathlib import Path

import numpy as np

from service.can.frames import FrameBlock

AXES, RATE_HZ, BITS, WATCHED_S = 20, 1000, 11, 20.0
INERTIA, FRICTION = 0.01, 0.02
HEAD = """\
[service]
state_dir = "state"
[[bus]]
name = "can0"
channel = "can0"
"""

MESSAGE = """\
[[bus.message]]
name = "drive{n}"
id = {can_id:#x}
signal = [
  {{ name = "torque", start_bit = 0, length = 16, kind = "signed", factor = 0.001 }},
  {{ name = "speed", start_bit = 16, length = 16, kind = "signed", factor = 0.01 }},
  {{ name = "count", start_bit = 32, length = {bits} }},
]
"""

ROBOT = """\
[[robot]]
name = "demo"
[robot.defaults]
sample_interval_s = {interval_s}
time = {{ counter_signal = "count" }}
estimator = {{ torque_noise = 0.05, output_noise = 0.01 }}
detector = {{ shadow = {shadow} }}
model = {{ drive = "one-mass", monitor = {monitored}, nominal = {nominal} }}
"""

AXIS = """\
[[robot.axis]]
name = "axis{n}"
torque = {{ message = "drive{n}", signal = "torque" }}
speed = {{ message = "drive{n}", signal = "speed" }}
"""

NOMINAL = "{ J = 0.01, fm = 0.02, fc = 0.0, tau0 = 0.0, kT = 1 }"


def configured(
    folder: Path,
    axes: int = AXES,
    rate_hz: int = RATE_HZ,
    bits: int = BITS,
    monitored: str = '["kT", "fm"]',
    nominal: str = NOMINAL,
    shadow: str = "true",
) -> Path:
    numbers = range(1, axes + 1)
    parts = [HEAD, *(MESSAGE.format(n=n, can_id=0x100 + n, bits=bits) for n in numbers)]
    parts.append(ROBOT.format(interval_s=1 / rate_hz, monitored=monitored, nominal=nominal, shadow=shadow))
    parts += [AXIS.format(n=n) for n in numbers]
    (folder / "robot.toml").write_text("".join(parts), encoding="utf-8")
    return folder / "robot.toml"


def frames(axes: int = AXES, rate_hz: int = RATE_HZ, bits: int = BITS, coulomb: float = 0.0) -> FrameBlock:
    """As many as the count has values, so that they can be repeated: the speeds are periodic."""
    count, periods = 2**bits, {3: 40.0, 8: 15.0}
    turns = 2 * np.pi * np.arange(count + 1) / count
    speed = sum((amplitude * np.sin(n * turns) for n, amplitude in periods.items()), np.zeros(count + 1))
    # By which the drive, with the torque held between its samples, has just these speeds: no alarm is right.
    decay = np.exp(-FRICTION / INERTIA / rate_hz)
    torque = FRICTION * (speed[1:] - decay * speed[:-1]) / (1 - decay) + coulomb * np.sign(speed[:-1])
    data = np.zeros((count, 8), np.uint8)
    columns = [np.rint(torque / 0.001), np.rint(speed[:-1] / 0.01), np.arange(count)]
    for k, column in enumerate(columns):
        data[:, 2 * k : 2 * k + 2] = column.astype("<i2").view(np.uint8).reshape(-1, 2)
    ids = np.tile(0x101 + np.arange(axes), count)
    t_us = np.repeat(np.arange(count) * 1_000_000 // rate_hz, axes)
    return FrameBlock.from_columns(t_us, ids, np.full(len(ids), 8), np.repeat(data, axes, axis=0))
