"""What a sample costs in the kernel."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import experiments
from monitor_core.modeling.standard_drives import reference_model
from monitor_core.monitoring import FEWEST_LANES
from tests.bench.axes import (
    LANES,
    ONE_BY_ONE,
    five_masses,
    five_masses_record,
    five_masses_settings,
    forced,
    run_of,
    run_of_five_masses,
    run_of_fleet,
    settings,
)
from tests.bench.costs import memory_mb
from tests.bench.measure import Say, in_turns
from tests.core.oracle.paper import Paper

pytestmark = pytest.mark.bench

BLOCK = 1000
DAEMON_BLOCK = 20
"""Samples of an axis at 200 Hz between two turns of the daemon's worker."""
TRANSCRIBED = 150
OUTPUTS: tuple[Output, ...] = ("speed", "angle")
AXES = (1, 6, 16, 64)
FEW = (2, 3, 4, 5, 6, 7, 8, 12, 16)
TARGET_US = {1: 1.5, 64: 0.25}
MANY, SECOND, TARGET_MS, TARGET_MB = 1000, 200, 60, 100


def test_many_axes(seed: int, say: Say) -> None:
    medians = in_turns({(o, axes): run_of(o, axes, BLOCK, seed) for o in OUTPUTS for axes in AXES}, 9)
    cost = {key: t / BLOCK / key[1] * 1e6 for key, t in medians.items()}
    say(
        "many axes: us per sample and axis",
        ("axes", *(f"{output} output" for output in OUTPUTS), "target (speed)"),
        [(axes, *(cost[o, axes] for o in OUTPUTS), TARGET_US.get(axes, "-")) for axes in AXES],
    )


def test_beside_the_transcription(seed: int, say: Say) -> None:
    """Three masses and three parameters, five and six."""
    runs = {"three": run_of, "five": run_of_five_masses}
    variants = {
        (drive, o, axes): run(o, axes, BLOCK, seed)
        for drive, run in runs.items()
        for o in OUTPUTS
        for axes in (1, 64)
    }
    papers = {(drive, o, 0): transcribed(drive, o, seed) for drive in runs for o in OUTPUTS}
    medians, rows = in_turns(variants | papers, 9), []
    for drive, output, axes in variants:
        ours = medians[drive, output, axes] / BLOCK / axes * 1e6
        theirs = medians[drive, output, 0] / TRANSCRIBED * 1e6
        target = TARGET_US[axes] if (drive, output) == ("three", "speed") else "-"
        rows.append((f"{drive} masses, {output}", axes, ours, target, theirs, f"{theirs / ours:.0f} times"))
    header = ("", "axes", "kernel", "target", "numpy and scipy", "ratio")
    say("us per sample and axis", header, rows)


def transcribed(drive: str, output: Output, seed: int) -> Callable[[], object]:
    if drive == "five":
        rec, model, s = (
            five_masses_record(output, 1, TRANSCRIBED, seed),
            five_masses(output),
            five_masses_settings(output),
        )
    else:
        rec, model = experiments([seed], output=output, samples=TRANSCRIBED), reference_model(output)
        s = settings(output, seed)
    return lambda: Paper(model, s).run(rec.t_us, rec.u[:, 0], rec.y[:, 0])


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
    variants = {
        (o, axes, shape): forced(run_of(o, axes, samples, seed), shape)
        for axes in FEW
        for o in OUTPUTS
        for shape in (ONE_BY_ONE, LANES)
    }
    medians = in_turns(variants, rounds)
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
