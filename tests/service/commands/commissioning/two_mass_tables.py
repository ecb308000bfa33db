"""Tables of axes of two masses in a position loop, with columns of their own names, and their configuration."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration import CalibrationOptions
from monitor_core.modeling import EXAMPLE_VALUES, SimulatedAxis, two_mass

H = 0.005
VALUES = {
    **EXAMPLE_VALUES["two-mass"],
    "Jm": 0.006,
    "Ja": 100.0,
    "k": 1.5e5,
    "d": 400.0,
    "fm": 0.06,
    "fc": 0.08,
    "r": 0.0085,
}
AXIS = """
[[robot.axis]]
name = "a{n}"  # on the floor
sample_interval_s = {interval}
time = {{ column = "Time" }}
torque = {{ column = "A{n}_Trq" }}
angle = {{ column = "A{n}_Pos" }}
estimator = {{ torque_noise = 1.0, output_noise = 1.0 }}
model = {{ drive = "two-mass", monitor = ["kT", "fm"], friction_speed_scale = 1.0, nominal = {{ kT = 1, r = 0.0085 }} }}
"""
RECEIVED = ["%.6f", "%.10g", "%.10g"]
"""Seconds since 1970, torque and angle of an axis."""
FEW = CalibrationOptions(120.0, 4.0, (0.3,), 3, copies=60_000, bank_copies=20_000)


def table(path: Path, seed: int, seconds: float, fault: float = 1.0, axes: int = 1, sign: int = 1) -> Path:
    """Axes in a position loop with a test signal; kT of the first is multiplied by a factor after half the time.

    ``sign``: of the torque as written.
    """
    rows = _rows(seed, seconds, fault, axes).copy()
    rows[:, 1::2] *= sign
    names = ["Time", *(f"A{n + 1}_{what}" for n in range(axes) for what in ("Trq", "Pos"))]
    formats = ["%.6f", *["%.10g"] * (2 * axes)]
    np.savetxt(path, rows, fmt=formats, delimiter=",", header=",".join(names), comments="")
    return path


@cache
def _rows(seed: int, seconds: float, fault: float, axes: int) -> Floats:
    """Time, torque and angle of each axis (N, 1 + 2 axes)."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds / H)) * H
    columns = [1.76e9 + t]
    for n in range(axes):
        period = 5.0 + 2.0 * n
        plant = SimulatedAxis(VALUES, 1.0, drive=two_mass("angle"))
        test = 0.6 * np.sign(rng.standard_normal(t.size)) * (np.arange(t.size) // 3 % 2) + 0.2 * rng.standard_normal(
            t.size
        )
        torque, angle = np.zeros(t.size), np.zeros(t.size)
        for k in range(t.size):
            if n == 0 and fault != 1 and k == t.size // 2:
                plant.set({**VALUES, "kT": fault})
            angle[k] = plant.angle + 1e-4 * rng.standard_normal()
            torque[k] = (
                0.08 * (6 * np.sin(2 * np.pi * t[k] / period) - plant.speed)
                + 0.6 * np.sin(2 * np.pi * t[k] / period)
                + test[k]
            )
            plant.step(torque[k] + 0.02 * rng.standard_normal(), H)
        columns += [torque, angle]
    return np.column_stack(columns)


def read_rows(path: Path) -> Floats:
    """Of a table: time, torque and angle of each axis (N, 1 + 2 axes)."""
    return np.loadtxt(path, delimiter=",", skiprows=1)


def write_rows(path: Path, rows: Floats, names: str | None = None, form: str | list[str] = "%.12g") -> Path:
    """A table with these rows; ``names``: of its columns, those that it has if they are not given."""
    head = path.read_text(encoding="utf-8").partition("\n")[0] if names is None else names
    np.savetxt(path, rows, form, ",", header=head, comments="")
    return path


def configured(path: Path, *axes: str) -> Path:
    path.write_text("# my robot\n[[robot]]\nname = 'cell'\n" + "".join(axes), encoding="utf-8")
    return path
