"""How long it takes from a Modelica file to the kernel's arrays, and what the command says of it."""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from time import perf_counter

import pytest

from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.modelica import Source, read
from monitor_core.modeling.statespace import drive_of, nominal_of
from tests.bench.measure import Say
from tests.end_to_end.processes import ROOT, run_program
from tests.service.modeling.long_drives import chain_text

pytestmark = pytest.mark.bench

TARGET_S = {3: 1.0, 5: 5.0}
MASSES = (2, 3, 5, 20, 100)
PATIENCE_S = 600.0
ROUNDS = 3

_ALONE = """
import sys
from pathlib import Path
from time import perf_counter
from monitor_core.drive.assembly import Assembly
from monitor_core.drive.axis_model import AxisModel
from service.config.drive_sources import model_called
start = perf_counter()
found = model_called(sys.argv[1])
model = AxisModel(found.drive, found.values, ("1/" + found.drive.parameters[0].name,))
Assembly(found.drive, model.monitored).model_constants(model, 1.0)
print(perf_counter() - start)
"""


def file_of(masses: int, folder: Path) -> Path:
    path = folder / f"chain{masses}.mo"
    path.write_text(chain_text(masses), encoding="utf-8")
    return path


def stages(path: Path) -> list[float]:
    """Seconds to read the text, to eliminate, and to the constants of one axis."""
    clock = [perf_counter()]
    flat = read([Source(path.name, path.read_text(encoding="utf-8"))])
    clock.append(perf_counter())
    space = eliminate(flat)
    clock.append(perf_counter())
    drive, values = drive_of(space), nominal_of(space)
    model = AxisModel(drive, values, (f"1/{drive.parameters[0].name}",))
    Assembly(drive, model.monitored).model_constants(model, 1.0)
    clock.append(perf_counter())
    return [end - begin for begin, end in pairwise(clock)]


def fresh(path: Path) -> tuple[float, float]:
    """Seconds of a process that does nothing else, and those behind its start and the kernel's imports."""
    start, command = perf_counter(), [sys.executable, "-c", _ALONE, str(path)]
    done = subprocess.run(command, cwd=ROOT, check=True, timeout=PATIENCE_S, capture_output=True, text=True)
    return perf_counter() - start, float(done.stdout)


def test_from_a_file_to_the_kernels_arrays(tmp_path: Path, say: Say) -> None:
    rows = []
    for masses in MASSES:
        path = file_of(masses, tmp_path)
        alone = sorted(fresh(path) for _ in range(ROUNDS))[ROUNDS // 2]
        best = min((stages(path) for _ in range(ROUNDS)), key=sum)
        commands = [command(path, *arguments) for arguments in ((), ("--json", "-"))]
        rows.append((masses, *alone, TARGET_S.get(masses, "-"), sum(best), *best, *commands))
    header = (
        "masses", "fresh process", "without imports", "target", "warm process", "read", "eliminate", "arrays",
        "axiswatch model", "with --json",
    )  # fmt: skip
    say("from a Modelica file to the kernel's arrays, and what the command says of it: s", header, rows)


def command(path: Path, *arguments: str) -> float:
    start = perf_counter()
    result = run_program("model", path, *arguments, patience_s=PATIENCE_S)
    assert result.returncode == 0, result.stderr
    return perf_counter() - start
