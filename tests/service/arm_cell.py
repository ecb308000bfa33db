"""The arm of ``tests.core.arm`` as its user has it: tables of its motion, a configuration, and what watches it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.calibration import CalibrationOptions
from monitor_core.detection import Alarm
from monitor_core.samples import SampleBlock
from service.commands.options import configuration
from service.pipeline.axis_monitors import AxisMonitors
from tests.core.arm import AXES, INTERVAL_S, STEP, Arm, ArmSamples, R
from tests.service.by_commands import CommandRefusedError, restarted, write_thresholds
from tests.service.command_line import axiswatch

MEMORY_S = 10.0
MIN_SPEED = 3.0
"""rad/s: below, the axis stands, and its friction may be anything."""
MONITOR = ("kT", "fm", "fc", "load")
SCHEDULES = {
    "shoulder": ("tau0: cos(q2), cos(q2 + q3)",),
    "elbow": ("tau0: cos(q2 + q3)",),
}
"""The shoulder holds the upper arm and what is beyond, the elbow what is beyond alone."""
START = {
    "shoulder": {"kT": 1.0, "J": 7e-3, "fm": 4e-3, "fc": 0.3, "tau0": -1.0},
    "elbow": {"kT": 1.0, "J": 3e-3, "fm": 1.5e-3, "fc": 0.1, "tau0": -0.4},
}


def write(path: Path, samples: ArmSamples) -> Path:
    """A table of samples."""
    columns = np.column_stack([samples.t_us * 1e-6, samples.u, samples.y])
    head = "t,torque2,torque3,angle2,angle3"
    formats = ["%.4f", *["%.8g"] * 2, *["%.10g"] * 2]
    np.savetxt(path, columns, fmt=formats, delimiter=",", header=head, comments="")
    return path


def configured(folder: Path, name: str, models: Mapping[str, str], monitor: Sequence[str] = MONITOR) -> Path:
    """A configuration of both axes, with these lines in [robot.axis.model] of each."""
    text = '[[robot]]\nname = "cell"\n'
    for number, axis in enumerate(AXES, 2):
        text += f"""\
[[robot.axis]]
name = "{axis}"
sample_interval_s = {INTERVAL_S}
time = {{ column = "t" }}
torque = {{ column = "torque{number}" }}
angle = {{ column = "angle{number}", resolution = {STEP} }}
min_speed = {MIN_SPEED}
estimator = {{ memory_s = {MEMORY_S} }}
"""
        for k in (2, 3):
            text += f'[[robot.axis.signal]]\nname = "q{k}"\ncolumn = "angle{k}"\nfactor = {R}\n'
        text += f"[robot.axis.model]\ndrive = 'one-mass'\nmonitor = {list(monitor)}\n{models[axis]}\n"
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def identified(folder: Path, records: Sequence[Path]) -> Path:
    """The configuration with what ``identify`` finds."""
    given = {
        axis: "nominal = {{ {} }}".format(", ".join(f"{n} = {v}" for n, v in values.items()))
        for axis, values in START.items()
    }
    config = configured(folder, "identify.toml", {axis: f"friction_speed_scale = 1.0\n{given[axis]}" for axis in AXES})
    for axis in AXES:
        schedule = [word for text in SCHEDULES[axis] for word in ("--schedule", text)]
        found, page = folder / f"{axis}.toml", folder / f"{axis}.html"
        result = axiswatch(
            "identify", *records, "--config", config, "--axis", axis, "--start", "values", "--force",
            "-o", found, "--report", page, *schedule,
        )  # fmt: skip
        print(result.output)
        if result.exit_code:
            raise CommandRefusedError(result.output[-1000:])
    return configured(folder, "found.toml", {axis: f'nominal_file = "{axis}.toml"' for axis in AXES})


def calibrated(config: Path, records: Sequence[Path], options: CalibrationOptions) -> Path:
    """The configuration with thresholds from these records, too."""
    write_thresholds(config, records, options)
    lines = {axis: f'nominal_file = "{axis}.toml"\nthresholds_file = "{axis}-thresholds.toml"' for axis in AXES}
    return configured(config.parent, "watched.toml", lines)


class ArmAlarm(NamedTuple):
    """An alarm of one axis, with seconds since the change."""

    axis: str
    parameter: str
    direction: str
    raised_s: float
    named_s: float
    size: float
    """As a share of the nominal value; NaN: not known"""


class Watcher:
    """The monitors of the daemon for both axes; it can be copied."""

    def __init__(self, config: Path, monitors: AxisMonitors | None = None) -> None:
        self._config = config
        self.monitors = monitors or AxisMonitors(configuration(config, without_bus=True).axes)

    def take(self, samples: ArmSamples) -> list[tuple[str, Alarm]]:
        """Alarms that changed in these samples, with their axis."""
        blocks = {
            f"cell.{axis}": SampleBlock(samples.t_us, samples.u[:, k], samples.y[:, k], signals=samples.y * R)
            for k, axis in enumerate(AXES)
        }
        found = self.monitors.update(blocks)
        return [(changed.axis_id.removeprefix("cell."), changed.alarm) for changed in found]

    def restarted(self) -> Watcher:
        """Another one that carries on from the checkpoint of this one."""
        return Watcher(self._config, restarted(self._config, self.monitors, 0))

    def nominal(self, axis: str, parameter: str) -> float:
        """Nominal value of a parameter."""
        model = self.monitors.by_id[f"cell.{axis}"].model
        return float(model.theta0[model.monitored.index(parameter)])


def after_change(arm: Arm, watcher: Watcher, changes: Mapping[str, float], seconds: float) -> list[ArmAlarm]:
    """All alarms, as named at last, within so many seconds after the arm changes now.

    Arm and monitors stay as they are.
    """
    arm, watcher, start_us = copy.deepcopy(arm), watcher.restarted(), 0
    found, named_s = dict[tuple[str, object], Alarm](), dict[tuple[str, object], float]()
    for second in range(round(seconds)):
        samples = arm.take(1.0, changes)
        start_us = start_us or int(samples.t_us[0])
        for axis, alarm in watcher.take(samples):
            found[axis, alarm.key] = alarm
            if alarm.stage == "named":
                named_s.setdefault((axis, alarm.key), second + 1.0)
    return [
        ArmAlarm(
            axis, e.parameter, e.direction, (e.raised_us - start_us) * 1e-6, named_s.get((axis, key), np.inf),
            np.nan if e.size is None else e.size / abs(watcher.nominal(axis, e.parameter)),
        )
        for (axis, key), e in found.items()
    ]  # fmt: skip
