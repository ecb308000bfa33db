"""The bank of hypotheses and the paper's detector on the reference experiment, beside the limit; the costs."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor_core.detection.bank import HypothesisBank
from monitor_core.kernel.tables import Floats
from monitor_core.reference import INTERVAL_S, MONITORED, experiment, reference_model
from tests.bench.measure import Say, in_turns
from tests.core.figures import settings_of
from tests.core.hypothesis_figures import (
    DAY,
    Delays,
    bank_of,
    delays,
    false_alarms,
    limit_s,
    paper_delays,
    within,
)

pytestmark = pytest.mark.bench

SEEDS = int(os.environ.get("AXISWATCH_BENCH_SEEDS", "1000"))
FACTORS = (1.2, 0.8)
MEASURED_AT, MEASURED_SAMPLES = 10.0, 1_000_000
FAULTS = tuple({name: factor} for factor in FACTORS for name in MONITORED)


def h_for_a_day(seed: int) -> tuple[float, str]:
    """h with one false alarm a day, from the rate at a lower one: it falls like exp(-h)."""
    alarms, tested = false_alarms(bank_of("speed", MEASURED_AT, seed), seed, MEASURED_SAMPLES)
    h = MEASURED_AT + math.log(max(alarms, 1) / tested * DAY)
    return (
        h,
        f"{alarms} false alarms in {tested * INTERVAL_S / 3600:.1f} h at h = {MEASURED_AT:g}, so h = {h:.1f}",
    )


def row(detector: str, fault: Mapping[str, float], limit: float, found: Delays) -> Iterator[object]:
    ((name, factor),) = fault.items()
    median, most = within(found.alarm)
    yield from (
        f"{name} {100 * (factor - 1):+.0f} %",
        detector,
        f"{median:.2f}",
        f"{most:.2f}",
        f"{median / limit:.2f}",
    )
    yield from (
        f"{100 * found.missed:.1f} %",
        f"{100 * found.right_at_alarm:.1f} %",
        f"{100 * found.right_named:.1f} %",
    )
    yield from (f"{within(found.named)[0]:.2f}", found.early)


def test_reference_experiment(seed: int, say: Say) -> None:
    h, words = h_for_a_day(seed)
    bank, paper = bank_of("speed", h, seed), settings_of("speed", seed, run_on=True)
    seeds = range(seed + 10_000, seed + 10_000 + SEEDS)
    rows: list[Sequence[object]] = []
    for fault in FAULTS:
        limit = limit_s(fault, range(seed, seed + 200), DAY)
        rows.append(list(row("bank", fault, limit, delays(bank, fault, seeds))))
        rows.append(list(row("paper", fault, limit, paper_delays(paper, fault, seeds))))
    header = (
        "fault",
        "detector",
        "delay s",
        "90 %",
        "/ limit",
        "missed",
        "right at alarm",
        "right named",
        "named s",
        "early",
    )
    say(
        f"Faults after 5 s of 10 s, {SEEDS} seeds; one false alarm a day: {words}; the paper's: 3 and 20",
        header,
        rows,
    )


@pytest.mark.parametrize("irregular", [False, True], ids=["regular", "irregular"])
def test_what_a_sample_costs(irregular: bool, seed: int, say: Say) -> None:
    model, s, samples = reference_model(), settings_of("speed", seed), 20_000
    t_us, u, y = experiment(seed, samples=samples)
    t_us = t_us + np.arange(samples) * 7 if irregular else t_us
    whole = bank_of("speed", math.inf, seed)
    banks = {
        n: HypothesisBank(model, s, (whole.hypotheses * 2)[: n - 2], h=math.inf) for n in (8, 24, 48, 96)
    }
    times = in_turns({n: _run(bank, t_us, u, y) for n, bank in banks.items()}, 7)
    rows = [(n, f"{1e6 * time / samples:.2f}") for n, time in times.items()]
    say(
        f"A bank of hypotheses, {'every interval another' if irregular else 'equal intervals'}",
        ("lanes", "us/sample"),
        rows,
    )


def _run(bank: HypothesisBank, t_us: NDArray[np.int64], u: Floats, y: Floats) -> Callable[[], object]:
    def run() -> object:
        bank.reset()
        return bank.run(t_us, u, y)

    return run
