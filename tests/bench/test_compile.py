"""How long it takes to compile the kernel, which happens once on each machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from monitor_core.monitoring import FEWEST_LANES
from service.pipeline.warming import HYPOTHESES
from tests.bench.measure import Say
from tests.end_to_end.processes import ROOT

pytestmark = pytest.mark.bench

_COMPILE = """
import os, sys
from time import perf_counter
from service.pipeline.warming import compile_kernel
from tests.bench.costs import memory_mb
start = perf_counter()
compile_kernel(int(sys.argv[1]))
print(perf_counter() - start, memory_mb(os.getpid(), "VmHWM"))
"""


def test_compile_time(tmp_path: Path, say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = []
    for shape, lanes in (("few axes", 1), ("many axes", FEWEST_LANES), ("hypotheses", HYPOTHESES)):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / shape.partition(" ")[0]))
        (cold, most_mb), (warm, _) = compiled(lanes), compiled(lanes)
        rows.append((f"kernel for {shape}", cold, most_mb, warm))
    say("compile the kernel", ("", "s", "most MB", "load from the cache, s"), rows)


def compiled(lanes: int) -> tuple[float, float]:
    command = [sys.executable, "-c", _COMPILE, str(lanes)]
    out = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    seconds, most_mb = out.split()
    return float(seconds), float(most_mb)
