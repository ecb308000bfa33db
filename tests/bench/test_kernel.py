"""What the kernel costs: a sample of the reference axis, and to compile it."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import experiments
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import FEWEST_LANES, AxisBatch, Fleet
from monitor_core.monitoring import axis_batch as batch_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from service.pipeline.kernel_cache import KernelShape
from tests.bench.measure import Say, in_turns, memory_mb
from tests.conftest import ROOT
from tests.core.figures import settings_of

pytestmark = pytest.mark.bench

BLOCK = 1000
DAEMON_BLOCK = 20
"""Samples of an axis at 200 Hz between two turns of the daemon's worker."""
BLOCKS = 10
"""Blocks until a record begins again."""
OUTPUTS: tuple[Output, ...] = ("speed", "angle")
AXES = (1, 6, 16, 64)
FEW = (2, 3, 4, 5, 6, 7, 8, 12, 16)
ONE_BY_ONE, LANES = 1_000_000, 1
"""Values of FEWEST_LANES that force a shape of the kernel."""
SUPERVISED = 0.05
"""Floor and starved, the defaults of a configuration."""
TARGET_US = {1: 1.5, 64: 0.25}
MANY, SECOND, TARGET_MS, TARGET_MB = 1000, 200, 60, 100


@cache
def reference_settings(output: Output, seed: int) -> Settings:
    """Of the reference experiment, with P(0), so that theta moves from the start, and P supervised as in the daemon."""
    return replace(settings_of(output, seed), information_floor=SUPERVISED, min_excitation=SUPERVISED)


def run_of(
    output: Output, axes: int, samples: int, seed: int, fewest_lanes: int = FEWEST_LANES
) -> Callable[[], object]:
    """A call that runs the next so many samples of so many reference axes, in a shape of the kernel.

    At the end of the records the batch restarts with them: a jump would throw theta to its bounds.
    """
    length = max(BLOCKS * samples, 2000)
    rec = experiments(range(seed, seed + axes), output=output, samples=length)
    batch = AxisBatch([reference_model(output)] * axes, [reference_settings(output, seed)] * axes)
    start = [batch.column(a) for a in range(axes)]
    t_us, at = np.repeat(rec.t_us[:, np.newaxis], axes, axis=1), 0

    def run() -> object:
        nonlocal at
        if at == length:
            at = 0
            for a, state in enumerate(start):
                batch.restore(a, *state)
        block, at = slice(at, at + samples), at + samples
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(batch_module, "FEWEST_LANES", fewest_lanes)
            return batch.run(t_us[block], rec.u[block], rec.y[block])

    return run


def test_many_axes(seed: int, say: Say) -> None:
    medians = in_turns({(o, axes): run_of(o, axes, BLOCK, seed) for o in OUTPUTS for axes in AXES}, 9)
    cost = {key: t / BLOCK / key[1] * 1e6 for key, t in medians.items()}
    say(
        "many axes: us per sample and axis",
        ("axes", *(f"{output} output" for output in OUTPUTS), "target (speed)"),
        [(axes, *(cost[o, axes] for o in OUTPUTS), TARGET_US.get(axes, "-")) for axes in AXES],
    )


def run_of_fleet(axes: int, samples: int, drives: int, seed: int) -> Callable[[], object]:
    """A function that runs the next ``samples`` of a fleet: the reference axis, and others that monitor less of it.

    Twenty times, then the records are at their end.
    """
    model = reference_model("speed")
    models = [replace(model, monitored=model.monitored[: 3 - a % drives]) for a in range(axes)]
    settings = replace(reference_settings("speed", seed), settle_s=0.0)
    fleet = Fleet(models, [replace(settings, P0=settings.P0[: len(m.monitored)]) for m in models])
    rec = experiments(range(seed, seed + 10), samples=2 * BLOCKS * samples)
    at = 0

    def run() -> object:
        nonlocal at
        block, at = slice(at, at + samples), at + samples
        return fleet.update(
            {a: SampleBlock(rec.t_us[block], rec.u[block, a % 10], rec.y[block, a % 10]) for a in range(axes)}
        )

    return run


def test_a_thousand_axes_for_a_second(seed: int, say: Say) -> None:
    """What the fleet of a plant costs: 200 samples of each axis in one call, of one drive and of three."""
    rows: list[tuple[object, ...]] = []
    for drives in (1, 3):
        before = memory_mb(os.getpid())
        call = run_of_fleet(MANY, SECOND, drives, seed)
        call()
        medians = in_turns({"fleet": call}, 9)
        grown = memory_mb(os.getpid()) - before
        rows.append((f"{drives} drives", medians["fleet"] * 1e3, TARGET_MS, grown, TARGET_MB))
    say(f"{MANY} axes, {SECOND} samples each", ("", "ms", "target", "MB more", "at most"), rows)


@pytest.mark.parametrize(("samples", "rounds"), [(DAEMON_BLOCK, 99), (BLOCK, 9)])
def test_few_axes_one_by_one_or_in_lanes(samples: int, rounds: int, seed: int, say: Say) -> None:
    keys = [(o, axes, shape) for axes in FEW for o in OUTPUTS for shape in (ONE_BY_ONE, LANES)]
    medians = in_turns({key: run_of(*key[:2], samples, seed, key[2]) for key in keys}, rounds)
    rows = []
    for axes in FEW:
        row: list[object] = [axes]
        for o in OUTPUTS:
            one_by_one, lanes = (medians[o, axes, shape] / samples / axes * 1e6 for shape in (ONE_BY_ONE, LANES))
            row += [one_by_one, lanes, one_by_one / lanes]
        rows.append(row)
    say(
        f"FEWEST_LANES (now {FEWEST_LANES}), blocks of {samples} samples: us per sample and axis",
        ("axes", *(f"{o} {what}" for o in OUTPUTS for what in ("one by one", "lanes", "ratio"))),
        rows,
    )


_COMPILE = """
import os, sys
from time import perf_counter
from service.pipeline.kernel_cache import KernelShape, compile_kernel
from tests.bench.measure import memory_mb
start = perf_counter()
compile_kernel(KernelShape(sys.argv[1]))
print(perf_counter() - start, memory_mb(os.getpid(), "VmHWM"))
"""


def test_compile_time(tmp_path: Path, say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    """It happens once on each machine."""
    rows = []
    for shape in KernelShape:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / shape))
        (cold, most_mb), (warm, _) = compiled(shape), compiled(shape)
        rows.append((f"kernel: {shape}", cold, most_mb, warm))
    say("compile the kernel", ("", "s", "most MB", "load from the cache, s"), rows)


def compiled(shape: KernelShape) -> tuple[float, float]:
    command = [sys.executable, "-c", _COMPILE, shape]
    out = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    seconds, most_mb = map(float, out.split())
    return seconds, most_mb
