"""The multi-model detector and the paper's detector on the reference experiment, beside the limit; the costs."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation.reference_experiment import experiment
from monitor_core.modeling.standard_drives import INTERVAL_S, MONITORED, reference_model
from tests.bench.measure import Say, in_turns
from tests.core.figures import settings_of
from tests.core.hypothesis_figures import (
    DAY,
    Delays,
    bank_of,
    delays,
    false_alarms,
    limit_s,
    model_of,
    settings_for,
    within,
)
from tests.core.paper_figures import calibrated, paper_delays

pytestmark = pytest.mark.bench

SEEDS = int(os.environ.get("AXISWATCH_BENCH_SEEDS", "1000"))
FACTORS = (1.2, 0.8)
MEASURED_AT, MEASURED_SAMPLES = 10.0, 1_000_000
FRICTION = {"fc": 0.4}
"""N m; the reference experiment has none.  A third of the torque, as of the real axis in config/irb.toml."""
HEADER = (
    "fault", "detector", "limit s", "delay s", "90 %", "/ limit", "missed", "right at alarm", "right named",
    "named s", "early",
)  # fmt: skip


def h_for_a_day(model: AxisModel, seed: int) -> tuple[float, str]:
    """h with one false alarm a day, from the rate at a lower one: it falls like exp(-h)."""
    bank = HypothesisBank(model, settings_for(model, seed), h=MEASURED_AT)
    alarms, tested = false_alarms(bank, seed, MEASURED_SAMPLES)
    h = MEASURED_AT + math.log(max(alarms, 1) / tested * DAY)
    return (
        h,
        f"{alarms} false alarms in {tested * INTERVAL_S / 3600:.1f} h at h = {MEASURED_AT:g}, so h = {h:.1f}",
    )


def row(detector: str, fault: Mapping[str, float], limit: float, found: Delays) -> list[object]:
    ((name, factor),) = fault.items()
    median, most = within(found.alarm)
    seconds = [limit, median, most, median / limit]
    shares = [found.missed, found.right_at_alarm, found.right_named]
    return [
        f"{name} {100 * (factor - 1):+.0f} %",
        detector,
        *(f"{v:.2f}" if math.isfinite(v) else "-" for v in seconds),
        *(f"{100 * v:.1f} %" for v in shares),
        f"{within(found.named)[0]:.2f}",
        found.early,
    ]


def both(model: AxisModel, names: Sequence[str], many: int, seed: int, say: Say) -> None:
    """Both detectors at one false alarm a day, in one table."""
    settings = settings_for(model, seed)
    h, words = h_for_a_day(model, seed)
    paper, own_words = calibrated(model, settings, seed, DAY)
    bank = HypothesisBank(model, settings, h=h)
    seeds = range(seed + 10_000, seed + 10_000 + many)
    rows = []
    for factor in FACTORS:
        for name in names:
            fault = {name: factor}
            # Friction goes by the measured speed: what two predictors of the same record differ by, the limit, is not
            # what two axes differ by.
            limit = math.nan if model.nominal["fc"] else limit_s(fault, seeds[:400], DAY, model)
            rows.append(row("multimodel", fault, limit, delays(bank, fault, seeds)))
            rows.append(row("paper", fault, limit, paper_delays(model, paper, fault, seeds)))
    title = (
        f"Faults after 5 s, missed 5 s later; monitored {', '.join(model.monitored)}; {many} seeds; both at one false"
        f" alarm a day"
    )
    say(f"{title}\nbank: {words}\npaper: {own_words}", HEADER, rows)


def test_reference_experiment(seed: int, say: Say) -> None:
    both(reference_model(), MONITORED, SEEDS, seed, say)


@pytest.mark.parametrize(
    ("monitored", "name", "values"),
    [((*MONITORED, "kg"), "kg", {}), (("kT", "1/Ja", "fc"), "fc", FRICTION)],
    ids=["kg", "fc"],
)
def test_where_others_are_monitored(
    monitored: Sequence[str], name: str, values: Mapping[str, float], seed: int, say: Say
) -> None:
    both(model_of(monitored, values), [name], SEEDS, seed, say)


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
        f"A multi-model detector, {'every interval another' if irregular else 'equal intervals'}",
        ("lanes", "us/sample"),
        rows,
    )


def test_what_a_sample_costs_in_the_blocks_of_the_daemon(seed: int, say: Say) -> None:
    """Every tenth of a second: what Python adds to each call, and what the making of a bank costs, once."""
    samples = 20_000
    t_us, u, y = experiment(seed, samples=samples)
    bank = bank_of("speed", math.inf, seed)

    def in_blocks(size: int) -> Callable[[], object]:
        def run() -> object:
            bank.reset()
            for k in range(0, samples, size):
                bank.run(t_us[k : k + size], u[k : k + size], y[k : k + size])
            return bank

        return run

    times = in_turns({size: in_blocks(size) for size in (20, 100, samples)}, 5)
    rows = [(size, f"{1e6 * time / samples:.2f}") for size, time in times.items()]
    say(f"A bank of {len(bank.hypotheses)} hypotheses, by samples in a block", ("samples", "us/sample"), rows)
    made = in_turns({"": lambda: bank_of("speed", math.inf, seed)}, 3)[""]
    say("Making a bank", ("", "s"), [("hypotheses found and told apart", f"{made:.2f}")])


def _run(bank: HypothesisBank, t_us: NDArray[np.int64], u: Floats, y: Floats) -> Callable[[], object]:
    def run() -> object:
        bank.reset()
        return bank.run(t_us, u, y)

    return run
