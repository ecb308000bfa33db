"""The way from one table of six axes, with columns as a vendor names them, to a configuration that ``run`` takes."""

import os
import re
import subprocess
import time
from collections.abc import Iterator
from math import degrees
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import pytest

from service.config import load
from service.config.drive_sources import shipped
from service.simulation.robot import table_lines
from tests.bench.measure import Say
from tests.end_to_end.processes import PROGRAM, ROOT, run_program

pytestmark = pytest.mark.bench

AXES, MINUTES, AIM_S = 6, 10.0, 600.0
COLUMNS = (
    "Timestamp[s]",
    *(f"Axis{n}.{w}" for n in range(1, 1 + AXES) for w in ("ActTorque[Nm]", "ActPos[deg]")),
)
PHASE = re.compile(r"robot1\.(\w+): (identify|calibrate) \.\.\.")
END = re.compile(r"\[\d/\d\] robot1\.(\w+): (.*)")


def write_table(path: Path, seed: int) -> Path:
    """The demo's robot, healthy, angles in degrees."""
    lines = table_lines(load(shipped("demo.toml"), {}), 60 * MINUTES, seed)
    next(lines)
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(COLUMNS) + "\n")
        for line in lines:
            t, *values = map(float, line.split(","))
            values[1::2] = map(degrees, values[1::2])
            file.write(",".join((f"{t:.6f}", *(f"{value:.10g}" for value in values))) + "\n")
    return path


def lines_of(*words: str | Path) -> Iterator[tuple[float, str]]:
    """The lines of a command, with the time of each since its start [s]; the last one is that of its end, empty."""
    began = time.monotonic()
    with subprocess.Popen(
        [*PROGRAM, *map(str, words)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            yield time.monotonic() - began, line
    assert process.returncode == 0
    yield time.monotonic() - began, ""


def cpu_s() -> float:
    """Of all processes that have ended."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_six_axes_of_ten_minutes(seed: int, say: Say, tmp_path: Path) -> None:
    record = write_table(tmp_path / "cell.csv", seed)
    config, made = tmp_path / "axis.toml", tmp_path / "commissioned"
    before_s, began = cpu_s(), time.monotonic()
    done = run_program("init", record, "-o", config)
    assert done.returncode == 0, done.stderr
    init_s, init_cpu_s = time.monotonic() - began, cpu_s() - before_s
    begins: dict[tuple[str, str], float] = {}
    ends: dict[str, tuple[float, str]] = {}
    all_s = 0.0
    for all_s, line in lines_of("commission", record, "--config", config, "-o", made, "--budget", "10min", "--yes"):
        if found := PHASE.match(line):
            begins.setdefault((found[1], found[2]), all_s)
        elif found := END.match(line):
            ends[found[1]] = all_s, found[2].partition(". ")[0]
    assert len(load(made / "axiswatch.toml").axes) == AXES
    rows: list[tuple[str, object, object, str]] = [
        ("init", init_s, init_cpu_s, ""),
        ("check of the signals", min(begins.values()), "", ""),
    ]
    for axis, (end_s, words) in sorted(ends.items()):
        first_s, then_s = begins[axis, "identify"], begins[axis, "calibrate"]
        rows += [
            (f"{axis}: identify", then_s - first_s, "", words),
            (f"{axis}: calibrate", end_s - then_s, "", ""),
        ]
    rows.append(("commission, all", all_s, cpu_s() - before_s - init_cpu_s, ""))
    rows.append(("init and commission", init_s + all_s, cpu_s() - before_s, f"aim: {AIM_S:.0f} s on two cores"))
    say(
        f"From a table of {AXES} axes, {MINUTES:.0f} minutes at 200 Hz, to a commissioned robot",
        ("step", "s", "CPU s", ""),
        rows,
    )
