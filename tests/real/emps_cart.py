"""The cart of the EMPS benchmark as a user would configure it, and the way of its record through the commands."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.injection import equivalent_load, faulty_torque
from monitor_core.detection import Alarm
from monitor_core.drive.assembly import Assembly
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from service.commands.calibrate import calibrate_axis
from service.commands.identification_task import Request, prepare
from service.config import Config, load
from service.ingest.calibration_records import read
from service.reports.calibration_report import Calibration
from service.reports.formats import Provenance
from service.reports.formats import Provenance as Identified
from service.reports.identification_files import as_toml
from tests.core.alarm_versions import alarm_versions
from tests.real.drives import ONE_MASS

GUESS = "nominal = { kT = 1.0, J = 100.0, fv = 200.0, fc = 20.0, tau0 = 0.0 }\nfriction_speed_scale = 0.001\n"
AXIS = f"""[[robot]]
name = "emps"
[[robot.axis]]
name = "cart"
sample_interval_s = 0.001
time = {{ column = "t" }}
torque = {{ column = "vir", factor = 35.15065188248547 }}
angle = {{ column = "qm" }}
[robot.axis.model]
drive = "cart.mo"
monitor = ["kT", "fc"]
{GUESS}
[robot.axis.estimator]
memory_s = 0.25
"""
HALF_S = 12.42
"""Of 24.84 s: the motion in the second half is that of the first, there and back twice."""
BUDGET_S = 600.0
"""Twelve seconds cannot promise much more."""


class Half(NamedTuple):
    """One half of the record: the text that selects it, and where it begins, s."""

    text: str
    start_s: float


def halves(path: Path) -> tuple[Half, Half]:
    """Both."""
    return Half(f"{path}@0:{HALF_S}", 0.0), Half(f"{path}@{HALF_S}:", HALF_S)


def identified(folder: Path, half: Half) -> Path:
    """A folder with nominal.toml found in that half, as ``axiswatch identify`` does."""
    (folder / "cart.mo").write_text(ONE_MASS, encoding="utf-8")
    config = configured(folder, AXIS)
    task = prepare(config, config.axes[0], [half.text], [], Request(start="values"))
    found = task.run(Identified("", "", ""))
    assert not found.rejection
    (folder / "nominal.toml").write_text(as_toml(found), encoding="utf-8")
    return folder


def watched(folder: Path, monitor: Sequence[str]) -> Config:
    """The configuration of the daemon, with the nominal values of that folder."""
    names = ", ".join(f'"{name}"' for name in monitor)
    text = AXIS.replace(GUESS, 'nominal_file = "nominal.toml"\n')
    return configured(folder, re.sub(r"monitor = .*", f"monitor = [{names}]", text))


def configured(folder: Path, text: str) -> Config:
    path = folder / "axis.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, {})


def calibrated(config: Config, half: Half, budget_s: float = BUDGET_S) -> Calibration:
    """Thresholds from that half, as ``axiswatch calibrate`` finds them."""
    request = CalibrationOptions(budget_s, None, (0.15,), 10, copies=2_000_000, bank_copies=500_000)
    return calibrate_axis(config, config.axes[0], [half.text], request, Provenance("", "", ""))


def samples(config: Config, found: Calibration, text: str) -> SampleBlock:
    """The record, or a part of it, through the pipeline of the daemon."""
    (one,), _ = read([text], config, config.axes[0], found.result.model)
    return one


def faulty(found: Calibration, one: SampleBlock, change: Mapping[str, float], start: int) -> SampleBlock:
    """From sample ``start`` on these parameters are off by such parts: the force that the same motion needed."""
    nominal = found.result.model.nominal
    values = {**nominal, **{name: nominal[name] * (1 + part) for name, part in change.items()}}
    load = equivalent_load(found.result.model, values)
    assert load is not None  # exact
    assembly = Assembly(found.result.model.drive, found.result.model.monitored)
    u_scale = assembly.model_constants(found.result.model, found.result.settings.speed_scale)["u_scale"]
    u = one.u.copy()
    u[start:] = faulty_torque(found.result.model, found.result.settings, one, load, u_scale)[start:]
    return one._replace(u=u)


def said(found: Calibration, one: SampleBlock) -> tuple[list[Alarm], AxisMonitor]:
    """All that the monitor reports of it, and the monitor."""
    monitor = AxisMonitor(found.result.model, found.result.settings)
    return alarm_versions(monitor, one)[0], monitor


def peak_of_g(found: Calibration, one: SampleBlock) -> float:
    """Largest g over its threshold, of any test."""
    monitor = AxisMonitor(found.result.model, found.result.settings)
    _, trace = monitor.update_traced(one)
    return float(np.max(trace.g.max(axis=(0, 1)) / monitor.batch.thresholds[:, 0]))
