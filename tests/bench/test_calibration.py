"""What it costs to calibrate an axis on ten minutes, beside the bare recursion over as many samples."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import pytest

from monitor_core.calibration.calibration_procedure import OBSERVED_SHARE, WITHIN_MEMORIES, CalibrationOptions
from monitor_core.calibration.surrogate_records import LANES, SAMPLES
from monitor_core.monitoring import AxisBatch
from service.commands.calibrate import calibrate_axis
from service.config import load
from service.config.axis_settings import axis_settings
from service.config.drives import axis_model
from service.ingest.calibration_records import read
from service.reports.formats import Provenance
from tests.bench.measure import Say
from tests.service.identification.conftest import write_record, write_robot

pytestmark = pytest.mark.bench

SECONDS, ONSETS = 600, 100
SIZES = (0.05, 0.1, 0.2, 0.3, 0.5)
BUDGET_S = 86400.0
TURNS = 1000
"""Samples of each of LANES axes at once, of the recursion alone."""


def test_ten_minutes(seed: int, say: Say, tmp_path: Path) -> None:
    config = load(write_robot(tmp_path), {})
    record = write_record(tmp_path / "healthy.csv", config, SECONDS, seed)
    ends: dict[str, tuple[float, float]] = {}

    def told(part: str, _: float, __: float) -> None:
        ends[part] = process_time(), perf_counter()

    def run(text: str, wishes: CalibrationOptions) -> None:
        ends.clear()
        told("start", 0.0, 0.0)
        calibrate_axis(config, config.axes[0], [text], wishes, Provenance("", "", ""), told)
        told("the rest", 0.0, 0.0)

    run(
        f"{record}@0:60", CalibrationOptions(600.0, None, (0.2,), 4, copies=100_000, bank_copies=25_000)
    )  # compiles
    run(str(record), CalibrationOptions(BUDGET_S, None, SIZES, ONSETS))
    rows: list[tuple[str, str, str]] = [
        (part, f"{cpu1 - cpu0:.1f}", f"{wall1 - wall0:.1f}")
        for (_, (cpu0, wall0)), (part, (cpu1, wall1)) in pairwise(ends.items())
    ]
    whole, wall = (end - start for start, end in zip(ends["start"], ends["the rest"], strict=True))
    rows.append(("all", f"{whole:.1f}", f"{wall:.1f}"))
    bare = _recursion_s(str(record), tmp_path) * _samples()
    rows.append((f"the recursion alone, {_samples() / 1e6:.0f} million samples", f"{bare:.1f}", ""))
    say(
        f"Calibrating on {SECONDS / 60:.0f} minutes at 200 Hz: 3 parameters, {len(SIZES)} sizes up and down, {ONSETS}"
        f" onsets each; {whole / bare:.1f} times the recursion alone",
        ("part", "CPU s", "s"),
        rows,
    )


def _samples() -> float:
    """That the monitors of copies and of faulty records see."""
    axis_s = WITHIN_MEMORIES * OBSERVED_SHARE  # the memory is a second
    return SAMPLES + 3 * 2 * len(SIZES) * ONSETS * axis_s * 200


def _recursion_s(text: str, folder: Path) -> float:
    """CPU time of a sample, of axes side by side."""
    config = load(folder / "robot.toml", {})
    axis = config.axes[0]
    model = axis_model(axis.config)
    (one,), _ = read([text], config, axis, model)
    bank, found = AxisBatch([model] * LANES, [axis_settings(axis, model)] * LANES), []
    for k in range(0, 12 * TURNS, TURNS):
        part = one.select(slice(k, k + TURNS))
        t_us = np.repeat(part.t_us[:, np.newaxis], LANES, axis=1)
        u, y = (np.repeat(v, LANES).reshape(TURNS, LANES) for v in (part.u, part.y))
        start = process_time()
        bank.run(t_us, u, y)
        found.append((process_time() - start) / u.size)
    return float(np.median(found))
