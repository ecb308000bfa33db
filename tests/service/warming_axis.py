"""The axis of ``tests.core.warming`` as its user has it: tables of its motion, a configuration, and what watches it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration import CalibrationOptions
from monitor_core.detection import Alarm
from monitor_core.drive.thermal_state import ThermalState
from monitor_core.samples import SampleBlock
from service.commands.command_line.options import configuration
from service.pipeline.axes.axis_monitors import AxisMonitors
from service.pipeline.axes.axis_pipeline import Heat
from service.texts.not_tested_words import not_tested_sentences
from tests.core.mismatch import INTERVAL_S, MOVING, STEP, Block, FaultAlarm, alarm_of
from tests.core.warming import WarmingPlant
from tests.service.by_commands import CommandRefusedError, restarted, write_thresholds
from tests.service.command_line import axiswatch

PARAMETERS = ("kT", "fc", "fm")
AXIS_ID = "cell1.axis1"
CUSUM = 'alarm_source = "cusum", shadow = false'
BUS = f"""\
[[bus]]
name = "can0"
interface = "virtual"
channel = "warming"
messages = "{Path(__file__).resolve().parents[2] / "config" / "demo.dbc"}"
"""
AXIS = f"""\
[[robot]]
name = "cell1"
[[robot.axis]]
name = "axis1"
sample_interval_s = {INTERVAL_S}
time = {{ column = "t" }}
torque = {{ column = "torque" }}
angle = {{ column = "angle", resolution = {STEP} }}
estimator = {{ memory_s = 5.0 }}
detector = {{ {CUSUM} }}
thermal = {{ unwatched = "stood" }}
[robot.axis.model]
drive = "three-mass"
friction_speed_scale = 1.0
monitor = {list(PARAMETERS)}
conditions = "others stand still"
"""
START_US = 1_760_000_000_000_000


def write(path: Path, block: Block, **signals: Floats) -> Path:
    """A table of samples, with further columns."""
    columns = np.column_stack([(START_US + block.t_us) * 1e-6, block.u, block.y, *signals.values()])
    head = ",".join(["t", "torque", "angle", *signals])
    formats = ["%.4f", "%.8g", "%.10g", *["%.6g"] * len(signals)]
    np.savetxt(path, columns, fmt=formats, delimiter=",", header=head, comments="")
    return path


def configured(folder: Path, name: str, lines: str) -> Path:
    """A configuration of an axis that is in tables only, with these lines in [robot.axis.model]."""
    path = folder / name
    path.write_text(AXIS + lines, encoding="utf-8")
    return path


def on_a_bus(config: Path) -> Path:
    """The configuration with a bus, which the daemon and ``replay`` ask for."""
    text = BUS + config.read_text(encoding="utf-8").replace("sample_interval_s", 'bus = "can0"\nsample_interval_s')
    for column, signal in (("torque", "Torque"), ("angle", "Angle")):
        text = text.replace(f'column = "{column}"', f'column = "{column}", message = "Axis1State", signal = "{signal}"')
    path = config.with_name("bus.toml")
    path.write_text(text, encoding="utf-8")
    return path


def identified(
    folder: Path, values: Mapping[str, float], records: Sequence[Path], *words: str, lines: str = ""
) -> tuple[Path, str]:
    """The configuration with what ``identify`` finds from these values, and what it says; ``lines``: more of it."""
    nominal = ", ".join(f"{name} = {value}" for name, value in values.items())
    config = configured(folder, "identify.toml", f"nominal = {{ {nominal} }}\n{lines}")
    found, page = folder / "nominal.toml", folder / "identify.html"
    result = axiswatch("identify", *records, "--config", config, "--force", "-o", found, "--report", page, *words)
    if result.exit_code:
        raise CommandRefusedError(result.output[-1000:])
    return configured(folder, "axis.toml", 'nominal_file = "nominal.toml"\n'), result.output


def calibrated(config: Path, records: Sequence[Path], options: CalibrationOptions) -> Path:
    """The configuration with thresholds from these records, too."""
    write_thresholds(config, records, options)
    lines = 'nominal_file = "nominal.toml"\nthresholds_file = "axis1-thresholds.toml"\n'
    return configured(config.parent, "watched.toml", lines)


class Watcher:
    """The monitor of the daemon for this axis; it can be copied."""

    def __init__(self, config: Path, monitors: AxisMonitors | None = None) -> None:
        self._config = config
        self._monitors = monitors or AxisMonitors(configuration(config, without_bus=True).axes)
        self.monitor = self._monitors.by_id[AXIS_ID]

    def take(self, block: Block) -> list[Alarm]:
        """Alarms that changed in these samples."""
        samples = SampleBlock(START_US + block.t_us, block.u, block.y)
        return [changed.alarm for changed in self._monitors.update({AXIS_ID: samples})]

    @property
    def heat(self) -> Heat | None:
        """How warm it believes the axis to be."""
        return self._monitors.axes[AXIS_ID].heat

    @property
    def thermal(self) -> ThermalState:
        """The state of its heat."""
        operating = self._monitors.axes[AXIS_ID].operating
        assert operating is not None
        assert operating.thermal is not None
        return operating.thermal

    @property
    def outside(self) -> tuple[str, ...]:
        """Conditions that are outside those of its records."""
        return self._monitors.axes[AXIS_ID].outside_calibration

    @property
    def not_tested(self) -> list[str]:
        """Why parameters are not tested, in sentences."""
        status = self.monitor.status()
        return [*not_tested_sentences(status.untested(), status, self._monitors.axes[AXIS_ID].gated_by)]

    def restarted(self) -> Watcher:
        """Another one that carries on from the checkpoint of this one."""
        return Watcher(self._config, restarted(self._config, self._monitors, START_US))


def after_fault(plant: WarmingPlant, watcher: Watcher, fault: Mapping[str, float], seconds: float) -> list[FaultAlarm]:
    """All alarms, as named at last, within so many seconds of motion after the plant breaks now.

    Plant and monitor stay as they are.
    """
    plant, watcher = copy.deepcopy(plant), watcher.restarted()
    plant.break_down(fault)
    found, start_us, moved_s, taken_s = dict[tuple[int, str], FaultAlarm](), 0, 0.0, 0.0
    while moved_s < seconds:
        block = plant.take(1.0)
        start_us = start_us or START_US + int(block.t_us[0])
        taken_s += 1.0
        for e in watcher.take(block):
            key = (e.raised_us, e.first[0])
            if e.stage == "named" and key not in found:
                found[key] = alarm_of(e, watcher.monitor.model, start_us, taken_s)
        moved_s += float(np.mean(np.abs(np.diff(block.y)) > MOVING * INTERVAL_S))
    return list(found.values())
