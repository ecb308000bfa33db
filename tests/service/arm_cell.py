"""The arm of ``tests.core.arm`` as its user has it: tables of its motion, a configuration, and what watches it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.calibration import CalibrationOptions
from monitor_core.detection import Alarm
from service.commands.command_line.options import configuration
from service.commands.commissioning.axis.load_search import LoadSearch
from service.config.conditions import needed
from service.ingest.samples.axis_columns import AxisColumns
from service.ingest.tables.csv_tables import CsvRows
from service.pipeline.axes.axis_monitors import AxisMonitors
from tests.core.arm import AXES, INTERVAL_S, STEP, Arm, ArmSamples, R
from tests.service.by_commands import CommandRefusedError, restarted, write_thresholds
from tests.service.command_line import axiswatch

MEMORY_S = 10.0
MIN_SPEED = 3.0
"""rad/s: below, the axis stands, and its friction may be anything."""
MONITOR = ("kT", "fm", "fc", "load")
SIGNALS = {
    **{axis: (axis, "") for axis in AXES},
    **{f"{axis}-{kind}": (axis, f"{kind} = true") for axis in AXES for kind in ("speed", "acceleration")},
}
"""By name: the axis, and what it is of its angle; all at the arm."""
WEIGHTS = {"shoulder": "cos(shoulder), cos(shoulder + elbow)", "elbow": "cos(shoulder + elbow)"}
"""The torque offset by weights alone: the shoulder holds upper arm and forearm, the elbow the forearm."""
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


def configured(
    folder: Path, name: str, models: Mapping[str, str], monitor: Sequence[str] = MONITOR, signals: bool = True
) -> Path:
    """A configuration of both axes, with these lines in [robot.axis.model] of each, and with the signals or without."""
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
        for signal, (moving, of_angle) in SIGNALS.items() if signals else ():
            text += f'[[robot.axis.signal]]\nname = "{signal}"\naxis = "{moving}"\nfactor = {R}\n{of_angle}\n'
        text += f"[robot.axis.model]\ndrive = 'one-mass'\nmonitor = {list(monitor)}\n{models[axis]}\n"
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def link_terms(folder: Path, records: Sequence[Path]) -> dict[str, str]:
    """What the torque offset of each axis follows, as ``commission`` finds it in these records."""
    bare = dict.fromkeys(AXES, f"nominal = {{ kT = 1.0, r = {R} }}")
    text = configured(folder, "links.toml", bare, ("kT", "fm", "fc"), signals=False).read_text(encoding="utf-8")
    terms = dict[str, str]()
    for axis in AXES:
        found = LoadSearch(text, f"cell.{axis}", [str(record) for record in records], folder).links
        if found is None:
            raise CommandRefusedError(f"the torque of the {axis} shows no load of links")
        terms[axis] = ", ".join(found.weights.terms)
        print(f"{axis}: {terms[axis]}; they explain {found.weights.explained:.1%} of the torque")
    return terms


def identified(folder: Path, records: Sequence[Path], offsets: Mapping[str, str] = WEIGHTS) -> Path:
    """The configuration with what ``identify`` finds, where the torque offsets follow these terms."""
    given = {
        axis: "nominal = {{ {} }}".format(", ".join(f"{n} = {v}" for n, v in values.items()))
        for axis, values in START.items()
    }
    config = configured(folder, "identify.toml", {axis: f"friction_speed_scale = 1.0\n{given[axis]}" for axis in AXES})
    for axis in AXES:
        schedule = ["--schedule", f"tau0: {offsets[axis]}"]
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
        axes = configuration(config, without_bus=True).axes
        self._config, self._rows = config, 0
        self._columns = {axis.id: AxisColumns(axis, needed(axis)) for axis in axes}
        self.monitors = monitors or AxisMonitors(axes)

    def take(self, samples: ArmSamples) -> list[tuple[str, Alarm]]:
        """Alarms that changed in these samples, with their axis."""
        names = ("t", "torque2", "torque3", "angle2", "angle3")
        table = np.column_stack([samples.t_us * 1e-6, samples.u, samples.y])
        rows = CsvRows(dict(zip(names, table.T, strict=True)), 1.0)
        found = self.monitors.update({a: columns.samples(rows, self._rows) for a, columns in self._columns.items()})
        self._rows += len(table)
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
