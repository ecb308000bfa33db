"""A configuration of the demo's first axes with columns for tables, and tables of its simulated robot."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from monitor_core.arrays import Floats
from service.config import NamedAxis, load
from service.simulation.axis import ControlledAxis, SimulatedSample
from service.simulation.robot import SimulatedFault, SimulatedRobot
from tests.end_to_end.processes import demo_config, edit

START_S = 1_760_000_000
COLUMNS = (
    ('signal = "Torque"', 'signal = "Torque"\ncolumn = "u"'),
    ('signal = "Angle"', 'signal = "Angle"\ncolumn = "phi"'),
    ("[robot.axis.time]", '[robot.axis.time]\ncolumn = "t"'),
)
HEAD = "t,u,phi\n"


def configured(folder: Path, channel: str, *changes: tuple[str, str], axes: int = 1) -> Path:
    """On a bus inside the process; the columns are those of the first axis, ``changes`` of the whole text."""
    file = demo_config(folder, f'interface = "virtual"\nchannel = "{channel}"', axes=axes)
    text = file.read_text(encoding="utf-8")
    for old, new in COLUMNS:
        text = text.replace(old, new, 1)
    file.write_text(text, encoding="utf-8")
    return edit(file, *changes)


def course(
    axis: NamedAxis, seed: int, samples: int, fault: Mapping[str, float] = {}, fault_at: int = 0
) -> tuple[Floats, Floats]:
    """Torque and motion (samples,) of a simulated axis, whose parameters have other factors from that sample on."""
    robot, readings = ControlledAxis(axis, np.random.default_rng(seed)), list[SimulatedSample]()
    for k in range(samples):
        if fault and k == fault_at:
            robot.break_down(fault)
        readings.append(robot.sample(k))
    return np.array([r.torque for r in readings]), np.array([r.motion for r in readings])


def rows(config: Path, seed: int, faults: Sequence[SimulatedFault], end_s: float) -> list[tuple[float, float, float]]:
    """Time since 1970 [s], torque and angle of the first axis."""
    found = []
    for moment in SimulatedRobot(load(config, {}), seed, list(faults)).moments():
        if moment.time_s > end_s:
            break
        u, phi, *_ = moment.readings["demo.axis1"]
        found.append((START_S + moment.time_s, u, phi))
    return found


def write_table(path: Path, config: Path, seed: int, faults: Sequence[SimulatedFault], end_s: float) -> Path:
    """The rows in a file."""
    lines = (f"{t:.6f},{u!r},{phi!r}\n" for t, u, phi in rows(config, seed, faults, end_s))
    path.write_text(HEAD + "".join(lines), encoding="utf-8")
    return path
