"""Every real record: commissioned on one half by the commands' own way, watched on the other, with exact faults.

``-s`` prints the table of docs/validation.md.  Nothing here was tuned on the half that is watched.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.calibration.injection import equivalent_load, faulty_torque
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from monitor_core.monitoring import AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from service.commands.calibrate import calibrate_axis
from service.commands.identification_task import Request, prepare
from service.config import Config, load
from service.ingest.loaded_records import load_samples
from service.reports.formats import Provenance
from service.reports.identification_files import as_toml
from tests.core.naming import alarm_versions
from tests.real.drives import ONE_MASS, WEIGHT

pytestmark = [pytest.mark.soak, pytest.mark.records]

BEGINS = (0.4, 0.5, 0.6)
"""Parts of the half after which a fault begins: before, P(0) is found; after, there is time to name it."""
PROVENANCE = Provenance("", "", "")


class Case(NamedTuple):
    """A record in two halves, and how it is watched.

    ``sure``: changes that must be named in every trial, each as one alarm.  ``others``: changes that are printed.
    """

    file: str
    middle_s: float
    axis: str
    drive: str
    monitor: tuple[str, ...]
    memory_s: float
    budget_s: float
    sure: tuple[tuple[str, float], ...]
    others: tuple[tuple[str, float], ...]


def ur10e(joint: int, interval_s: float) -> str:
    """An axis of the configuration: columns without names, angles from 1 on and currents from 13 on."""
    return f"""sample_interval_s = {interval_s}
pairing_tolerance_s = 0.004
time = {{ column = "0" }}
torque = {{ column = "{12 + joint}" }}
angle = {{ column = "{joint}" }}
"""


EMPS = """sample_interval_s = 0.001
time = { column = "t" }
torque = { column = "vir", factor = 35.15065188248547 }
angle = { column = "qm" }
"""
KT = (("kT", 0.2), ("kT", -0.2))
FRICTION = (("fc", 0.3), ("fc", -0.3), ("fv", 0.5), ("fv", -0.5))
ALONE = "ur10e/ur-20_01_22-joint_{}.csv"
CASES = {
    "EMPS": Case("emps/DATA_EMPS.mat", 12.42, EMPS, "light", ("kT", "fc"), 0.25, 600, KT, FRICTION),
    "UR10e joint 1": Case(
        ALONE.format(1), 31, ur10e(1, 0.0107), "light", ("kT", "fc"), 0.6, 180, KT, FRICTION
    ),
    "UR10e joint 2": Case(
        ALONE.format(2), 31, ur10e(2, 0.0107), "heavy", ("kT", "fc"), 0.6, 180, KT, FRICTION
    ),
}  # fmt: skip


def configured(case: Case, folder: Path, values: str) -> Config:
    names = ", ".join(f'"{name}"' for name in case.monitor)
    text = (
        f'[[robot]]\nname = "robot"\n[[robot.axis]]\nname = "axis"\n{case.axis}[robot.axis.model]\n'
        f'drive = "{case.drive}.mo"\nmonitor = [{names}]\n{values}\n'
        f"[robot.axis.estimator]\nmemory_s = {case.memory_s}\n"
    )
    (folder / "axis.toml").write_text(text, encoding="utf-8")
    return load(folder / "axis.toml", {})


class Watched(NamedTuple):
    """The model and settings from one half, and the other half; the verdict on the fit, in per cent."""

    model: AxisModel
    settings: Settings
    block: SampleBlock
    explained: float

    def alarms(self, block: SampleBlock) -> list[Alarm]:
        return alarm_versions(AxisMonitor(self.model, self.settings), block)[0]

    def with_fault(self, name: str, part: float, start: int) -> SampleBlock:
        """The other half with a change from sample ``start`` on: the torque that the same motion needs."""
        model, nominal = self.model, self.model.nominal
        load = equivalent_load(model, {**nominal, name: nominal[name] * (1 + part)})
        assert load is not None  # exact
        u = self.block.u.copy()
        u[start:] = faulty_torque(MonitoredAxis(model, self.settings), self.block, load)[start:]
        return self.block._replace(u=u)


def commissioned(case: Case, own: str, other: str, folder: Path) -> Watched:
    (folder / "light.mo").write_text(ONE_MASS, encoding="utf-8")
    (folder / "heavy.mo").write_text(ONE_MASS.replace("equation\n", WEIGHT), encoding="utf-8")
    config = configured(case, folder, "nominal = { kT = 1.0 }")
    report = prepare(config, config.axes[0], [own], [], Request()).run(PROVENANCE)
    (folder / "nominal.toml").write_text(as_toml(report), encoding="utf-8")
    config = configured(case, folder, 'nominal_file = "nominal.toml"')
    options = CalibrationOptions(case.budget_s, None, (0.2,), 5, copies=4_000_000, bank_copies=50_000)
    found = calibrate_axis(config, config.axes[0], [own], options, PROVENANCE).result
    (block,), _ = load_samples([other], config, config.axes[0], found.model)
    return Watched(found.model, found.settings, block, report.result.verdict.per_cent)


class Trial(NamedTuple):
    """What became of one change: its alarms, the last form of the first one, the delay."""

    alarms: int
    last: Alarm | None
    delay_s: float


def trials(watched: Watched, name: str, part: float) -> Iterator[Trial]:
    for share in BEGINS:
        start = round(share * len(watched.block.u))
        versions = watched.alarms(watched.with_fault(name, part, start))
        if not versions:
            yield Trial(0, None, np.inf)
            continue
        first = [alarm for alarm in versions if alarm.key == versions[0].key]
        delay_s = (versions[0].raised_us - int(watched.block.t_us[start])) * 1e-6
        yield Trial(len({alarm.key for alarm in versions}), first[-1], delay_s)


@pytest.mark.parametrize("name", CASES)
def test_either_half_watched_with_what_the_other_gave(name: str, records_dir: Path, tmp_path: Path) -> None:
    case = CASES[name]
    path = records_dir / case.file
    halves = [f"{path}@0:{case.middle_s}", f"{path}@{case.middle_s}:"]
    both = [commissioned(case, own, other, tmp_path) for own, other in (halves, halves[::-1])]
    print(f"\n{name}: explained {', '.join(f'{watched.explained:.0f} %' for watched in both)}")
    for watched in both:
        assert watched.alarms(watched.block) == []
    for parameter, part in (*case.sure, *case.others):
        found = [trial for watched in both for trial in trials(watched, parameter, part)]
        print(f"| {parameter} {100 * part:+.0f} % | {_row(found, both[0].model)} |")
        if (parameter, part) in case.sure:
            direction = "up" if part > 0 else "down"
            for trial in found:
                assert trial.last is not None
                assert (trial.alarms, trial.last.parameter, trial.last.direction) == (1, parameter, direction)


def _row(found: Sequence[Trial], model: AxisModel) -> str:
    """Found, names, delays (median, longest), sizes over the nominal value (smallest to largest)."""
    raised = [trial for trial in found if trial.last is not None]
    names = dict[str, int]()
    sizes = list[float]()
    for trial in raised:
        alarm = trial.last
        assert alarm is not None
        named = f"{alarm.parameter} {alarm.direction}" if alarm.stage == "named" else "changed"
        names[named] = names.get(named, 0) + 1
        if alarm.size is not None:
            sizes.append(alarm.size / _nominal(model.nominal, alarm.parameter))
    delays = [trial.delay_s for trial in raised]
    most = max((trial.alarms for trial in raised), default=0)
    counted = ", ".join(f"{count} {name}" for name, count in names.items()) or "none"
    delay = f"{np.median(delays):.1f} ({max(delays):.1f}) s" if delays else ""
    size = f"{100 * min(sizes):+.0f} to {100 * max(sizes):+.0f} %" if sizes else ""
    return f"{len(raised)} of {len(found)} | {counted} | {most} | {delay} | {size}"


def _nominal(nominal: Mapping[str, float], name: str) -> float:
    return abs(nominal[name])
