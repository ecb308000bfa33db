"""Axes without a thermometer that warm up by their own friction: ten days with a cold start each.

Gearboxes of another law than that of the monitor (tests/core/warming.py), redrawn; commissioned by ``identify`` and
``calibrate`` from records of two mornings, with nothing said of any temperature.  ``AXISWATCH_PLANTS`` is the number of
axes, ``AXISWATCH_DAYS`` that of days.  Each fault is tried on the first, the fourth and the last day, cold and warm.
The hall is colder or warmer on each day, by ``AXISWATCH_HALL_SD`` of what the axis warms up by itself.
"""

import os
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.calibration import CalibrationError, CalibrationOptions
from monitor_core.excitation import multisine
from tests.core.mismatch import INTERVAL_S, FaultAlarm
from tests.core.mismatch_monitor import FOUND
from tests.core.warming import WarmingPlant, redrawn_warming
from tests.service.by_commands import CommandRefusedError
from tests.service.warming_axis import Watcher, after_fault, calibrated, identified, write

pytestmark = pytest.mark.soak

PLANTS = int(os.environ.get("AXISWATCH_PLANTS", 20))
DAYS = int(os.environ.get("AXISWATCH_DAYS", 10))
HALL_SD = float(os.environ.get("AXISWATCH_HALL_SD", 0.2))
"""In warmths: of an axis that becomes 20 degrees warmer than the hall, 0.2 are 4 degrees."""
EXCITE_S, RECORD_S, DAY_S, NIGHT_S, LUNCH_S = 60.0, 2700.0, 7200.0, 14 * 3600.0, 1800.0
"""Two records of three quarters of an hour; days of two hours with a pause in the middle."""
FAULTS: dict[str, tuple[str, float, float]] = {
    "kT +20 %": ("kT", 1.2, 60.0),
    "kT -20 %": ("kT", 0.8, 60.0),
    "fm +50 %": ("fm", 1.5, 300.0),
    "fm -50 %": ("fm", 0.5, 300.0),
    "fc +30 %": ("fc", 1.3, 300.0),
}
"""Parameter, factor, and seconds of motion within which it is to be named."""
LEAST = 0.95
"""Share of the faults that is named right, by one alarm."""
BUDGET = CalibrationOptions(3.15576e7, 30.0, (0.3,), 1, bank_copies=20_000)


class Tried(NamedTuple):
    """A fault and all alarms that it raised."""

    plant: int
    day: int
    hour: float
    fault: str
    alarms: Sequence[FaultAlarm]

    @property
    def right(self) -> bool:
        """Whether one alarm names it."""
        parameter, factor, _ = FAULTS[self.fault]
        names = [(a.parameter, a.direction) for a in self.alarms]
        return names == [(parameter, "up" if factor > 1 else "down")]


class Run(NamedTuple):
    """What became of one axis."""

    false: list[str]
    tried: list[Tried]
    hours: float


def commissioned(number: int, seed: int, folder: Path) -> tuple[WarmingPlant, Path]:
    """The axis after two mornings, and the configuration that was found in their records."""
    rng = np.random.default_rng([seed, number])
    truth, warming = redrawn_warming(rng)
    plant, records = WarmingPlant(rng, truth, warming), list[Path]()
    signal = multisine(rng, round(EXCITE_S / INTERVAL_S), INTERVAL_S, (0.5, 30.0), 1.5)
    excited = write(folder / "excite.csv", plant.take(EXCITE_S, test=signal))
    plant.rest(NIGHT_S)
    for name in ("monday.csv", "tuesday.csv"):
        records.append(write(folder / name, plant.take(RECORD_S)))
        plant.enter(rng.normal(0.0, HALL_SD))
        plant.rest(NIGHT_S)
    # The masses from an excitation of a minute, and what is watched from the motion of operation.
    config, _ = identified(folder, FOUND, [excited], "--thermal", "off")
    found = tomllib.loads((folder / "nominal.toml").read_text(encoding="utf-8"))["values"]
    config, output = identified(folder, found, records, "--start", "values", "--free", "kT,fm,fc,tau0")
    print(f"\nplant {number}: {warming}")
    print("\n".join(line for line in output.splitlines() if "follows heat" in line), flush=True)
    return plant, calibrated(config, records, BUDGET)


def watched(number: int, seed: int, folder: Path) -> Run:
    """All days of one axis."""
    plant, config = commissioned(number, seed, folder)
    watcher, false, tried, hours = Watcher(config), list[str](), list[Tried](), 0.0
    halls = np.random.default_rng([seed, number, DAYS]).normal(0.0, HALL_SD, DAYS).tolist()
    for day, hall in enumerate(halls):
        plant.enter(hall)
        for part, half in enumerate(("morning", "afternoon")):
            seen = set[object]()
            for piece in range(2):
                for e in watcher.take(plant.take(DAY_S / 4)):
                    if e.key not in seen:
                        day_words = f"day {day}, hall {hall:+.2f}, {half}"
                        false.append(f"{day_words}: {e.parameter} {e.direction} {e.stage}, {watcher.heat}")
                    seen.add(e.key)
                hours += DAY_S / 4 / 3600
                if day in (0, 3, DAYS - 1) and (part, piece) in ((0, 0), (1, 1)):
                    for fault, (name, factor, seconds) in FAULTS.items():
                        alarms = after_fault(plant, watcher, {name: factor}, seconds)
                        tried.append(Tried(number, day, part + piece / 2, fault, alarms))
            plant.rest(LUNCH_S if part == 0 else NIGHT_S)
            watcher = watcher.restarted()
    return Run(false, tried, hours)


def test_ten_days_with_a_cold_start_each(seed: int, tmp_path: Path) -> None:
    runs, refused = list[Run](), list[int]()
    for number in range(PLANTS):
        folder = tmp_path / str(number)
        folder.mkdir()
        try:
            runs.append(watched(number, seed, folder))
        except (CommandRefusedError, CalibrationError) as error:
            refused.append(number)
            print(f"plant {number}: {error}", flush=True)
            continue
        print(f"plant {number}: false alarms {runs[-1].false}")
        for trial in runs[-1].tried:
            if not trial.right:
                print(f"   {trial}", flush=True)
    tried = [trial for run in runs for trial in run.tried]
    false = sum(len(run.false) for run in runs)
    print(f"\n{false} false alarms in {sum(run.hours for run in runs):.0f} h of {len(runs)} axes; refused {refused}")
    for fault in FAULTS:
        own = [trial for trial in tried if trial.fault == fault]
        good = [trial.alarms[0] for trial in own if trial.right]
        if not good:
            print(f"{fault}: 0 of {len(own)} named by one alarm")
            continue
        delays, sizes = ([getattr(a, name) for a in good] for name in ("named_s", "size"))
        held = sum(a.holds(FAULTS[fault][1] - 1) for a in good)
        print(
            f"{fault}: {len(good)} of {len(own)} named by one alarm, after {np.median(delays):.0f} s (at most"
            f" {max(delays):.0f}), size {100 * np.median(sizes):+.0f} % (medians), {held} of {len(good)} within"
            " their 90 %"
        )
    assert not refused
    assert false == 0
    assert np.mean([trial.right for trial in tried]) >= LEAST
