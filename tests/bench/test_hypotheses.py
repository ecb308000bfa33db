"""The multi-model detector and the paper's detector on the reference experiment, beside the limit; the costs.

The paper's has thresholds for a rate of false alarms, and names its alarms in two stages.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import nu_over_sigma, rates, thresholds
from monitor_core.calibration.healthy_records import deviations
from monitor_core.calibration.healthy_statistics import healthy_statistics
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation.reference_experiment import FAULT_AT, experiment
from monitor_core.modeling.standard_drives import INTERVAL_S, MONITORED, reference_model
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.bench.measure import Say, in_turns
from tests.core.figures import AT_ONCE, settings_of
from tests.core.hypothesis_figures import (
    DAY,
    WITHIN_S,
    Delays,
    Reaction,
    bank_of,
    delays,
    false_alarms,
    limit_s,
    model_of,
    records,
    settings_for,
    summed_up,
    within,
)

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
HEALTHY = 120_000
"""Samples of the record from which thresholds come: ten minutes."""
WITHIN = 3.0
"""Memories in which the smallest fault is to be found."""


def h_for_a_day(model: AxisModel, seed: int) -> tuple[float, str]:
    """h with one false alarm a day, from the rate at a lower one: it falls like exp(-h)."""
    bank = HypothesisBank(model, settings_for(model, seed), h=MEASURED_AT)
    alarms, tested = false_alarms(bank, seed, MEASURED_SAMPLES)
    h = MEASURED_AT + math.log(max(alarms, 1) / tested * DAY)
    return (
        h,
        f"{alarms} false alarms in {tested * INTERVAL_S / 3600:.1f} h at h = {MEASURED_AT:g}, so h = {h:.1f}",
    )


def calibrated(model: AxisModel, settings: Settings, seed: int, between: float) -> tuple[Settings, str]:
    """Settings with thresholds that most likely alarm once in so many samples of a healthy axis; how it is known."""
    axis, rng = MonitoredAxis(model, settings), np.random.default_rng([seed, 1])
    t_us, u, y = records(model, [seed], samples=HEALTHY)
    healthy = [SampleBlock(t_us, u[:, 0], y[:, 0], name="healthy")]
    k = nu_over_sigma(len(model.scale), settings.memory, between, WITHIN)
    known = healthy_statistics(axis, healthy, deviations(axis, healthy), k, rng)
    asked = between
    for _ in range(4):  # what is asked for is kept with certainty, and more than that is most likely
        same = np.random.default_rng(seed)
        own = thresholds(known.scatter, known.tails, np.zeros(len(model.scale)), asked, same)
        found = rates(known.scatter, known.tails, own, np.random.default_rng(seed))
        asked *= found.total * between
    times = [INTERVAL_S / 3600 / rate for rate in (found.total, found.upper, found.lower)]
    alphas = ", ".join(
        f"{t.alpha1:.2f} and {t.alpha2 / size:.1f}"
        for t, size in zip(own, np.abs(model.theta0) / model.scale, strict=True)
    )
    words = (
        f"one false alarm in {times[0]:.0f} h ({times[1]:.0f} to {times[2]:.0f} h), by calibration on ten minutes and"
        f" extrapolated {found.beyond:.0f} times: alpha_1 and alpha_2 {alphas}"
    )
    return replace(settings, thresholds=own, run_on=False), words


def paper_delays(model: AxisModel, settings: Settings, fault: Mapping[str, float], seeds: Sequence[int]) -> Delays:
    """The first alarm, its first name, and the one that it gets three memory lengths later."""
    (right,) = fault
    found = [
        outcome
        for k in range(0, len(seeds), AT_ONCE)
        for outcome in _outcomes(model, settings, fault, seeds[k : k + AT_ONCE])
    ]
    return summed_up(found, right)


def _outcomes(model: AxisModel, settings: Settings, fault: Mapping[str, float], seeds: Sequence[int]) -> list[Reaction]:
    t_us, u, y = records(model, seeds, fault)
    W = len(seeds)
    bank = AxisBatch([model] * W, [settings] * W)
    monitors = [AxisMonitor.of_lane(bank, a) for a in range(W)]
    found = [Reaction() for _ in range(W)]
    for a, event in bank.run(np.repeat(t_us[:, np.newaxis], W, axis=1), u, y):
        for _, e in monitors[a].apply([event]):
            delay = (e.raised_us - int(t_us[FAULT_AT])) * 1e-6 + INTERVAL_S
            if found[a].early or delay > WITHIN_S:
                continue
            if delay <= 0:
                found[a] = Reaction(early=True)
            elif not found[a].cause:
                found[a] = Reaction(alarm=delay, cause=e.parameter)
            if e.stage == "named" and not found[a].name and not found[a].early:
                when = (e.updated_us - int(t_us[FAULT_AT])) * 1e-6 + INTERVAL_S
                found[a] = found[a]._replace(named=when, name=e.parameter)
    return found


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


def test_what_a_sample_costs(seed: int, say: Say) -> None:
    model, s, samples = reference_model(), settings_of("speed", seed), 20_000
    t_us, u, y = experiment(seed, samples=samples)
    full_bank, rows = bank_of("speed", math.inf, seed), []
    for lanes in (8, 24, 48, 96):
        bank = HypothesisBank(model, s, (full_bank.hypotheses * 2)[: lanes - 2], h=math.inf)
        k = np.arange(samples)
        times = {"regular": t_us, "rounded": t_us + k % 2, "irregular": t_us + k * 7}
        found = in_turns({name: _run(bank, t, u, y) for name, t in times.items()}, 7)
        rows.append((lanes, *(f"{1e6 * time / samples:.2f}" for time in found.values())))
    header = ("lanes", "equal intervals", "rounded to 1 us", "no nominal interval")
    say("A multi-model detector: us/sample", header, rows)


def test_what_a_sample_costs_in_the_blocks_of_the_daemon(seed: int, say: Say) -> None:
    """Every tenth of a second: what Python adds to each call, and what the making of a bank costs, once."""
    samples = 20_000
    t_us, u, y = experiment(seed, samples=samples)
    bank = bank_of("speed", math.inf, seed)

    def in_blocks(size: int) -> Callable[[], object]:
        def run() -> object:
            bank.reset()
            for k in range(0, samples, size):
                bank.run(SampleBlock(t_us[k : k + size], u[k : k + size], y[k : k + size]))
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
        return bank.run(SampleBlock(t_us, u, y))

    return run
