"""A real record in two halves: commissioned on the one by the commands' own way, watched on the other, exact faults."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.injection import equivalent_load, faulty_torque
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from service.commands.commissioning.axis.calibration_task import calibrate_axis
from service.commands.commissioning.axis.identification_task import Request, prepare
from service.config import Config, load
from service.ingest.records.loaded_records import load_samples
from service.reports.formats import Provenance
from service.reports.identification_files import as_toml
from service.reports.identification_report import IdentificationReport
from tests.core.naming import alarm_versions

PROVENANCE = Provenance("", "", "")
EMPS = """sample_interval_s = 0.001
time = { column = "t" }
torque = { column = "vir", factor = 35.15065188248547 }
angle = { column = "qm" }
"""
"""Its columns."""


class RealAxis(NamedTuple):
    """The lines of an axis, its drive as a Modelica text, how it is watched, and the lines of values to start from."""

    lines: str
    drive: str
    monitor: tuple[str, ...]
    memory_s: float
    guess: str = "nominal = { kT = 1.0 }\n"

    def config(self, folder: Path, values: str) -> Config:
        (folder / "axis.mo").write_text(self.drive, encoding="utf-8")
        names = ", ".join(f'"{name}"' for name in self.monitor)
        text = (
            f'[[robot]]\nname = "robot"\n[[robot.axis]]\nname = "axis"\n{self.lines}[robot.axis.model]\n'
            f'drive = "axis.mo"\nmonitor = [{names}]\n{values}'
            f"[robot.axis.estimator]\nmemory_s = {self.memory_s}\n"
        )
        (folder / "axis.toml").write_text(text, encoding="utf-8")
        return load(folder / "axis.toml", {})


def identified(axis: RealAxis, half: str, folder: Path, request: Request | None = None) -> IdentificationReport:
    """Nominal values from that half, a text that selects it, into a file, even if they are rejected."""
    config = axis.config(folder, axis.guess)
    report = prepare(config, config.axes[0], [half], [], request or Request()).run(PROVENANCE)
    (folder / "nominal.toml").write_text(as_toml(report), encoding="utf-8")
    return report


class Watched(NamedTuple):
    """The model and settings from one half, and the other half."""

    model: AxisModel
    settings: Settings
    block: SampleBlock

    def alarms(self, block: SampleBlock) -> list[Alarm]:
        return alarm_versions(AxisMonitor(self.model, self.settings), block)[0]

    def with_fault(self, parts: Mapping[str, float], start: int) -> SampleBlock:
        """The other half if these change by such parts of their values at sample ``start``."""
        change = {name: part * self.model.nominal[name] for name, part in parts.items()}
        return with_fault(MonitoredAxis(self.model, self.settings), self.block, change, start)


def with_fault(axis: MonitoredAxis, block: SampleBlock, change: Mapping[str, float], start: int) -> SampleBlock:
    """The record if these values change by so much at sample ``start``: the torque that the same motion needs."""
    nominal = axis.model.nominal
    values = {**nominal, **{name: nominal[name] + by for name, by in change.items()}}
    load = equivalent_load(axis.model, values)
    assert load is not None  # exact
    u = block.u.copy()
    u[start:] = faulty_torque(axis, block, load)[start:]
    return block._replace(u=u)


def watched(axis: RealAxis, own: str, other: str, folder: Path, options: CalibrationOptions) -> Watched:
    """With the nominal values in the folder and thresholds from one half, the other as the daemon sees it."""
    config = axis.config(folder, 'nominal_file = "nominal.toml"\n')
    found = calibrate_axis(config, config.axes[0], [own], options, PROVENANCE).result
    (block,), _ = load_samples([other], config, config.axes[0], found.model)
    return Watched(found.model, found.settings, block)
