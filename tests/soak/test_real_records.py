"""Every real record: commissioned on one half by the commands' own way, watched on the other, with exact faults.

``-s`` prints the table of docs/validation.md.  Nothing here was tuned on the half that is watched.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from monitor_core.detection import Alarm
from monitor_core.drive.axis_model import AxisModel
from tests.real.drives import ONE_MASS, WEIGHT
from tests.real.halves import EMPS, RealAxis, Watched, identified, watched

pytestmark = [pytest.mark.soak, pytest.mark.records]

BEGINS = (0.4, 0.5, 0.6)
"""Parts of the half after which a fault begins: before, P(0) is found; after, there is time to name it."""


class Case(NamedTuple):
    """A record in two halves, and how it is watched.

    ``sure``: changes that must be named in every trial, each as one alarm.  ``others``: changes that are printed.
    """

    file: str
    middle_s: float
    axis: RealAxis
    budget_s: float
    sure: tuple[tuple[str, float], ...] = (("kT", 0.2), ("kT", -0.2))
    others: tuple[tuple[str, float], ...] = (("fc", 0.3), ("fc", -0.3), ("fv", 0.5), ("fv", -0.5))


def ur10e(joint: int, drive: str) -> Case:
    """A joint that moves alone: columns without names, angles from 1 on and currents from 13 on."""
    lines = f"""sample_interval_s = 0.0107
pairing_tolerance_s = 0.004
time = {{ column = "0" }}
torque = {{ column = "{12 + joint}" }}
angle = {{ column = "{joint}" }}
"""
    return Case(f"ur10e/ur-20_01_22-joint_{joint}.csv", 31, RealAxis(lines, drive, ("kT", "fc"), 0.6), 180)


CASES = {
    "EMPS": Case("emps/DATA_EMPS.mat", 12.42, RealAxis(EMPS, ONE_MASS, ("kT", "fc"), 0.25), 600),
    "UR10e joint 1": ur10e(1, ONE_MASS),
    "UR10e joint 2": ur10e(2, ONE_MASS.replace("equation\n", WEIGHT)),
}


class Trial(NamedTuple):
    """What became of one change: its alarms, the last form of the first one, the delay."""

    alarms: int
    last: Alarm | None
    delay_s: float


def trials(half: Watched, name: str, part: float) -> Iterator[Trial]:
    for share in BEGINS:
        start = round(share * len(half.block.u))
        versions = half.alarms(half.with_fault({name: part}, start))
        if not versions:
            yield Trial(0, None, np.inf)
            continue
        first = [alarm for alarm in versions if alarm.key == versions[0].key]
        delay_s = (versions[0].raised_us - int(half.block.t_us[start])) * 1e-6
        yield Trial(len({alarm.key for alarm in versions}), first[-1], delay_s)


@pytest.mark.parametrize("name", CASES)
def test_either_half_watched_with_what_the_other_gave(name: str, records_dir: Path, tmp_path: Path) -> None:
    case = CASES[name]
    path = records_dir / case.file
    halves = [f"{path}@0:{case.middle_s}", f"{path}@{case.middle_s}:"]
    options = CalibrationOptions(case.budget_s, None, (0.2,), 5, copies=4_000_000, bank_copies=50_000)
    both = list[Watched]()
    for own, other in (halves, halves[::-1]):
        report = identified(case.axis, own, tmp_path)
        print(f"\n{name}: explained {report.result.verdict.per_cent:.0f} %")
        both.append(watched(case.axis, own, other, tmp_path, options))
        assert both[-1].alarms(both[-1].block) == []
    for parameter, part in (*case.sure, *case.others):
        found = [trial for half in both for trial in trials(half, parameter, part)]
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
