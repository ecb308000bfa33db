"""Arms of two axes that carry a payload and warm up without a thermometer: days with a cold start each.

All values redrawn (tests/core/warming_arm.py); commissioned by ``identify`` and ``calibrate`` from two cold mornings of
operation with the usual payload: the torque offset follows the pose and what it takes to move the links, in the terms
that ``commission`` finds; friction follows the heat that nobody measures.  Each day has a pause at noon, and the daemon
restarts after each stop.  ``AXISWATCH_PLANTS`` is the number of arms, ``AXISWATCH_DAYS`` that of days.  Each change is
tried on the first and the last day, cold and warm.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from monitor_core.calibration import CalibrationOptions
from tests.core.warming_arm import WarmingArm, redrawn_warming_arm
from tests.service.arm_cell import Watcher, after_change, calibrated, identified, link_terms, write
from tests.service.arm_changes import CASES, FAULTS, PAYLOADS, Tried, table, try_arms

pytestmark = pytest.mark.soak

PLANTS = int(os.environ.get("AXISWATCH_PLANTS", 20))
DAYS = int(os.environ.get("AXISWATCH_DAYS", 10))
RECORD_S, HALF_DAY_S, NIGHT_S, LUNCH_S, WATCH_S = 2400.0, 2400.0, 14 * 3600.0, 1800.0, 300.0
BUDGET = CalibrationOptions(3.15576e7, 60.0, (0.2,), 1, copies=4_000_000, bank_copies=20_000)
LEAST = 0.95
"""Share of the changes of which all that is raised is right."""


def days_of(number: int, seed: int, folder: Path) -> tuple[list[str], list[Tried]]:
    """False alarms of one arm, and what it makes of each change."""
    rng = np.random.default_rng([seed, number])
    truth, warming = redrawn_warming_arm(rng)
    arm, records = WarmingArm(truth, warming, rng), list[Path]()
    for name in ("monday.csv", "tuesday.csv"):
        records.append(write(folder / name, arm.take(RECORD_S)))
        print(f"arm {number}: {name} ends at a warmth of {arm.warmth}", flush=True)
        arm.rest(NIGHT_S)
    watcher = Watcher(calibrated(identified(folder, records, link_terms(folder, records)), records, BUDGET))
    false, found = set[str](), list[Tried]()
    for day in range(DAYS):
        for half, pause_s in (("morning", LUNCH_S), ("afternoon", NIGHT_S)):
            if day in (0, DAYS - 1) and half == "morning":
                found += changed(number, arm, watcher)
            for axis, e in watcher.take(arm.take(HALF_DAY_S)):
                false.add(f"day {day}, {half}, {axis}: {e.first} at {e.raised_us * 1e-6:.0f} s")
            if day in (0, DAYS - 1) and half == "afternoon":
                found += changed(number, arm, watcher)
            arm.rest(pause_s)
            watcher = watcher.restarted()
    return sorted(false), found


def changed(number: int, arm: WarmingArm, watcher: Watcher) -> list[Tried]:
    """What is made of each change, if it happened now."""
    return [Tried(number, name, after_change(arm, watcher, case.changes, WATCH_S)) for name, case in CASES.items()]


def test_days_with_a_cold_start_each(seed: int, tmp_path: Path) -> None:
    trials, false, refused = try_arms(PLANTS, tmp_path, lambda number, folder: days_of(number, seed, folder))
    hours = (PLANTS - len(refused)) * DAYS * 2 * HALF_DAY_S / 3600
    print(f"\n{len(false)} false alarms in {hours:.0f} h of {PLANTS - len(refused)} arms; refused {refused}")
    print(table(trials))
    assert not refused
    assert false == []
    for group in (PAYLOADS, FAULTS):
        assert np.mean([trial.called_right for trial in trials if trial.case in group]) >= LEAST
