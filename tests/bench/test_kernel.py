"""What the kernel costs: a sample of the reference axis and of one of five masses, and to compile it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.kalman import filter_gain
from monitor_core.drive.structure import Output
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS, Experiment, experiments
from monitor_core.modeling.simulated_axis import simulate_linear
from monitor_core.modeling.standard_drives import INTERVAL_S, reference_model
from monitor_core.monitoring import FEWEST_LANES, AxisBatch, Fleet
from monitor_core.monitoring import axis_batch as bank_module
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from service.pipeline.warming import HYPOTHESES
from tests.bench.measure import Say, in_turns, memory_mb
from tests.conftest import ROOT
from tests.core.chains import chain, values
from tests.core.figures import ANGLE_TORQUE_NOISE, settings_of
from tests.core.oracle.paper import Paper

pytestmark = pytest.mark.bench

BLOCK = 1000
DAEMON_BLOCK = 20
"""Samples of an axis at 200 Hz between two turns of the daemon's worker."""
BLOCKS = 10
"""Blocks until a record begins again."""
TRANSCRIBED = 150
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


def axes_of(
    masses: int, output: Output, axes: int, samples: int, seed: int
) -> tuple[AxisModel, Settings, Experiment]:
    """The reference axis, or five masses and six parameters, excited alike, with records of so many axes.

    The five have Coulomb friction of motor and arm, which the plant does not have.
    """
    if masses == 3:
        rec = experiments(range(seed, seed + axes), output=output, samples=samples)
        return reference_model(output), reference_settings(output, seed), rec
    linear = {**values(5, gravity=False), "fc": 0.0, "fa": 0.0}
    model = AxisModel(chain(5, output, gravity=False), linear, ("kT", "f", "1/J5", "J2", "k1", "k4"))
    gain, lam0 = filter_gain(model, INTERVAL_S, ANGLE_TORQUE_NOISE, NOISE[output])
    start = tuple((0.01 * model.scale) ** 2 / lam0)
    settings = Settings.paper(INTERVAL_S, lam0=lam0, K=tuple(gain) if output == "angle" else (), P0=start)
    rng = np.random.default_rng(seed)
    u = np.stack([multisine(rng, samples, INTERVAL_S, BAND_HZ, TORQUE_RMS) for _ in range(axes)], axis=1)
    y, _ = simulate_linear(model.drive, model.nominal, u, INTERVAL_S)
    t_us = np.arange(samples, dtype=np.int64) * round(INTERVAL_S * 1e6)
    return model, settings, Experiment(t_us, u, y + NOISE[output] * rng.standard_normal(y.shape))


def run_of(
    masses: int, output: Output, axes: int, samples: int, seed: int, fewest_lanes: int = FEWEST_LANES
) -> Callable[[], object]:
    """A call that runs the next so many samples of so many axes, in a shape of the kernel.

    At the end of the records the bank restarts with them: a jump would throw theta to its bounds.
    """
    length = max(BLOCKS * samples, 2000)
    model, settings, rec = axes_of(masses, output, axes, length, seed)
    bank = AxisBatch([model] * axes, [settings] * axes)
    start = [bank.column(a) for a in range(axes)]
    t_us, at = np.repeat(rec.t_us[:, np.newaxis], axes, axis=1), 0

    def run() -> object:
        nonlocal at
        if at == length:
            at = 0
            for a, state in enumerate(start):
                bank.restore(a, *state)
        block, at = slice(at, at + samples), at + samples
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(bank_module, "FEWEST_LANES", fewest_lanes)
            return bank.run(t_us[block], rec.u[block], rec.y[block])

    return run


def test_many_axes(seed: int, say: Say) -> None:
    medians = in_turns({(o, axes): run_of(3, o, axes, BLOCK, seed) for o in OUTPUTS for axes in AXES}, 9)
    cost = {key: t / BLOCK / key[1] * 1e6 for key, t in medians.items()}
    say(
        "many axes: us per sample and axis",
        ("axes", *(f"{output} output" for output in OUTPUTS), "target (speed)"),
        [(axes, *(cost[o, axes] for o in OUTPUTS), TARGET_US.get(axes, "-")) for axes in AXES],
    )


def test_beside_the_transcription(seed: int, say: Say) -> None:
    """Three masses and three parameters, five and six."""
    drives = [(masses, output) for masses in (3, 5) for output in OUTPUTS]
    variants = {(*drive, axes): run_of(*drive, axes, BLOCK, seed) for drive in drives for axes in (1, 64)}
    papers = {(*drive, 0): transcribed(*drive, seed) for drive in drives}
    medians, rows = in_turns(variants | papers, 9), []
    for masses, output, axes in variants:
        ours = medians[masses, output, axes] / BLOCK / axes * 1e6
        theirs = medians[masses, output, 0] / TRANSCRIBED * 1e6
        target = TARGET_US[axes] if (masses, output) == (3, "speed") else "-"
        rows.append((f"{masses} masses, {output}", axes, ours, target, theirs, f"{theirs / ours:.0f} times"))
    header = ("", "axes", "kernel", "target", "numpy and scipy", "ratio")
    say("us per sample and axis", header, rows)


def transcribed(masses: int, output: Output, seed: int) -> Callable[[], object]:
    model, settings, rec = axes_of(masses, output, 1, TRANSCRIBED, seed)
    return lambda: Paper(model, settings).run(rec.t_us, rec.u[:, 0], rec.y[:, 0])


def run_of_fleet(axes: int, samples: int, drives: int, seed: int) -> Callable[[], object]:
    """A call that runs the next so many samples of a fleet: the reference axis, and others that monitor less of it.

    Twenty times, then the records are at their end.
    """
    model = reference_model("speed")
    models = [replace(model, monitored=model.monitored[: 3 - a % drives]) for a in range(axes)]
    one = replace(reference_settings("speed", seed), settle_s=0.0)
    fleet = Fleet(models, [replace(one, P0=one.P0[: len(m.monitored)]) for m in models])
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
    medians = in_turns({key: run_of(3, *key[:2], samples, seed, key[2]) for key in keys}, rounds)
    rows = []
    for axes in FEW:
        row: list[object] = [axes]
        for o in OUTPUTS:
            one, lanes = (medians[o, axes, shape] / samples / axes * 1e6 for shape in (ONE_BY_ONE, LANES))
            row += [one, lanes, one / lanes]
        rows.append(row)
    say(
        f"FEWEST_LANES (now {FEWEST_LANES}), blocks of {samples} samples: us per sample and axis",
        ("axes", *(f"{o} {what}" for o in OUTPUTS for what in ("one by one", "lanes", "ratio"))),
        rows,
    )


_COMPILE = """
import os, sys
from time import perf_counter
from service.pipeline.warming import compile_kernel
from tests.bench.measure import memory_mb
start = perf_counter()
compile_kernel(int(sys.argv[1]))
print(perf_counter() - start, memory_mb(os.getpid(), "VmHWM"))
"""


def test_compile_time(tmp_path: Path, say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    """It happens once on each machine."""
    rows = []
    for shape, lanes in (("few axes", 1), ("many axes", FEWEST_LANES), ("hypotheses", HYPOTHESES)):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / shape.partition(" ")[0]))
        (cold, most_mb), (warm, _) = compiled(lanes), compiled(lanes)
        rows.append((f"kernel for {shape}", cold, most_mb, warm))
    say("compile the kernel", ("", "s", "most MB", "load from the cache, s"), rows)


def compiled(lanes: int) -> tuple[float, float]:
    command = [sys.executable, "-c", _COMPILE, str(lanes)]
    out = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    seconds, most_mb = map(float, out.split())
    return seconds, most_mb
