"""What it costs to calibrate an axis on ten minutes."""

from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time

import pytest

from monitor_core.calibration.calibration_procedure import CalibrationOptions
from service.commands.commissioning.axis.calibration_task import calibrate_axis
from service.config import load
from service.reports.formats import Provenance
from tests.bench.measure import Say
from tests.service.commands.identify.conftest import write_record, write_robot

pytestmark = pytest.mark.bench

SECONDS, ONSETS = 600, 100
SIZES = (0.05, 0.1, 0.2, 0.3, 0.5)
BUDGET_S = 86400.0


def test_ten_minutes(seed: int, say: Say, tmp_path: Path) -> None:
    config = load(write_robot(tmp_path), {})
    record = write_record(tmp_path / "healthy.csv", config, SECONDS, seed)
    ends: dict[str, tuple[float, float]] = {}

    def note_time(part: str, _: float, __: float) -> None:
        ends[part] = process_time(), perf_counter()

    def run(text: str, wishes: CalibrationOptions) -> None:
        ends.clear()
        note_time("start", 0.0, 0.0)
        calibrate_axis(config, config.axes[0], [text], wishes, Provenance("", "", ""), note_time)
        note_time("the rest", 0.0, 0.0)

    few = CalibrationOptions(600.0, None, (0.2,), 4, copies=100_000, bank_copies=25_000)
    run(f"{record}@0:60", few)  # compiles
    run(str(record), CalibrationOptions(BUDGET_S, None, SIZES, ONSETS))
    rows: list[tuple[str, str, str]] = [
        (part, f"{cpu1 - cpu0:.1f}", f"{wall1 - wall0:.1f}")
        for (_, (cpu0, wall0)), (part, (cpu1, wall1)) in pairwise(ends.items())
    ]
    cpu, wall = (end - start for start, end in zip(ends["start"], ends["the rest"], strict=True))
    rows.append(("all", f"{cpu:.1f}", f"{wall:.1f}"))
    say(
        f"Calibrating on {SECONDS / 60:.0f} minutes at 200 Hz: 3 parameters, {len(SIZES)} sizes up and down, {ONSETS}"
        " onsets each",
        ("part", "CPU s", "s"),
        rows,
    )
