"""The reference experiment seen by the multi-model detector: how fast, and how often named right."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.calibration.monitored_axis import MonitoredAxis
from monitor_core.calibration.simulated_copies import Plants
from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.detection.multimodel.multimodel_detector import least_delay
from monitor_core.detection.multimodel.naming import CauseIdentified, ChangeDetected
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Output
from monitor_core.excitation.reference_experiment import (
    FAULT_AT,
    NOISE,
    SAMPLES,
    Experiment,
    experiments,
    faulty,
)
from monitor_core.modeling.standard_drives import INTERVAL_S, REFERENCE_VALUES, reference_model, three_mass
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import AT_ONCE, settings_of, steady_p_of

BLOCK = 100
DAY = 86400 / INTERVAL_S
WITHIN_S = 5.0
"""After the fault: what comes later is missed."""
WATCHED = FAULT_AT + round((WITHIN_S + 3.5) / INTERVAL_S)
"""Samples, so that the last alarm, too, is named after its three memories."""


def bank_of(output: Output, h: float, seed: int) -> HypothesisBank:
    return HypothesisBank(reference_model(output), settings_of(output, seed), h=h)


def model_of(monitored: Sequence[str], values: Mapping[str, float]) -> AxisModel:
    """The reference drive with other parameters monitored, and other nominal values."""
    return AxisModel(three_mass("speed"), {**REFERENCE_VALUES, **values}, tuple(monitored))


def settings_for(model: AxisModel, seed: int) -> Settings:
    """The paper's, with P(0) of this model."""
    settings = replace(settings_of(model.drive.output, seed), P0=())
    return replace(settings, P0=steady_p_of(model, settings, records(model, range(seed, seed + 50), samples=4000)))


def records(
    model: AxisModel,
    seeds: Sequence[int],
    fault: Mapping[str, float] | None = None,
    *,
    samples: int = WATCHED,
    noise: float | None = None,
) -> Experiment:
    """The reference experiment, also of an axis with Coulomb friction, which goes by the measured speed as the model's.

    Without friction these are ``experiments``; with it the same torques and the same noise.
    """
    output, nominal = model.drive.output, model.nominal
    found = experiments(seeds, fault, output=output, samples=samples, noise=noise)
    if not nominal["fc"]:
        return found
    healthy = experiments(seeds, output=output, samples=samples, noise=0.0).y
    eps = experiments(seeds, output=output, samples=samples, noise=noise).y - healthy
    plants = Plants(MonitoredAxis(model, Settings.paper(INTERVAL_S)), [nominal, faulty(nominal, fault or {})])
    W = len(seeds)
    which, x, rest = np.zeros(W, np.int64), np.zeros((W, len(model.drive.states))), np.zeros(W)
    before, x = plants.run(which, x, rest, found.u[:FAULT_AT], eps[:FAULT_AT])
    after, _ = plants.run(which + 1, x, found.u[FAULT_AT - 1], found.u[FAULT_AT:], eps[FAULT_AT:])
    return Experiment(found.t_us, found.u, np.concatenate([before, after]))


class Delays(NamedTuple):
    """One row: delays [s] of the alarm and of the name; infinite where it did not come."""

    alarm: Floats  # (seeds,)
    named: Floats
    right_at_alarm: float
    right_named: float
    early: int  # alarms before the fault
    late_names: int  # not certain

    @property
    def missed(self) -> float:
        return float(np.mean(~np.isfinite(self.alarm)))

    def __str__(self) -> str:
        (median, most), (named, _) = within(self.alarm), within(self.named)
        shares = f"missed {self.missed:.3f}, right at the alarm {self.right_at_alarm:.3f}, named {self.right_named:.4f}"
        return f"alarm {median:.2f} ({most:.2f}) s, named {named:.2f} s, {shares}, early {self.early}"


class Reaction(NamedTuple):
    """The alarm in a record and its name: delays in seconds, infinite where there is none."""

    alarm: float = math.inf
    cause: str = ""
    named: float = math.inf
    name: str = ""
    early: bool = False
    certain: bool = True


def delays(bank: HypothesisBank, fault: Mapping[str, float], seeds: Sequence[int]) -> Delays:
    """Of those that alarm and are named, before the record's end, which share has the right cause."""
    (right,) = fault
    found: list[Reaction] = []
    for k in range(0, len(seeds), AT_ONCE):
        t_us, u, y = records(bank.model, seeds[k : k + AT_ONCE], fault)
        found += [_run(bank, Experiment(t_us, u[:, a], y[:, a])) for a in range(u.shape[1])]
    return summed_up(found, right)


def summed_up(found: Sequence[Reaction], right: str) -> Delays:
    """One row, of faults in that parameter."""
    return Delays(
        np.array([reaction.alarm for reaction in found]),
        np.array([reaction.named for reaction in found]),
        share([reaction.cause == right for reaction in found if reaction.cause]),
        share([reaction.name == right for reaction in found if reaction.name]),
        sum(reaction.early for reaction in found),
        sum(not reaction.certain for reaction in found),
    )


def share(flags: Sequence[bool]) -> float:
    """The share of flags that are set; NaN if there are none."""
    return float(np.mean(flags)) if flags else math.nan


def _run(bank: HypothesisBank, rec: Experiment) -> Reaction:
    bank.reset()
    reaction = Reaction()
    for at in range(0, len(rec.u), BLOCK):
        block = slice(at, at + BLOCK)
        for event in bank.run(SampleBlock(rec.t_us[block], rec.u[block], rec.y[block])):
            delay = (event.time_us - rec.t_us[FAULT_AT]) * 1e-6 + INTERVAL_S
            if isinstance(event, ChangeDetected) and not 0 < delay <= WITHIN_S:
                return reaction._replace(early=delay <= 0)
            if isinstance(event, ChangeDetected):
                reaction = reaction._replace(alarm=delay, cause=event.shares[0].cause)
            elif isinstance(event, CauseIdentified):
                return reaction._replace(named=delay, name=event.shares[0].cause, certain=event.certain)
    return reaction


def false_alarms(bank: HypothesisBank, seed: int, samples: int) -> tuple[int, int]:
    """Alarms of a healthy record, and samples tested; after each alarm the bank restarts."""
    t_us, u, y = records(bank.model, [seed], samples=samples)
    rec = Experiment(t_us, u[:, 0], y[:, 0])
    at, alarms, settling = 0, 0, round(bank.settings.settle_s / INTERVAL_S)
    begun = 0
    while at < samples:
        bank.reset()
        begun += 1
        at = _until_alarm(bank, rec, at)
        alarms += at < samples
    return alarms, samples - begun * settling


def _until_alarm(bank: HypothesisBank, rec: Experiment, at: int) -> int:
    while at < len(rec.u):
        block = slice(at, at + 20 * BLOCK)
        events = bank.run(SampleBlock(rec.t_us[block], rec.u[block], rec.y[block]))
        if events:
            return int(np.searchsorted(rec.t_us, events[0].time_us)) + 1
        at += 20 * BLOCK
    return len(rec.u)


def within(delay: Floats) -> tuple[float, float]:
    """Median and 90 % quantile of delays that may be infinite."""
    median, most = np.quantile(delay, [0.5, 0.9], method="higher")
    return float(median), float(most)


def limit_s(
    fault: Mapping[str, float], seeds: Sequence[int], samples_between: float, model: AxisModel | None = None
) -> float:
    """The limit for a fault of the reference experiment, over the records of these seeds."""
    axis_model = model or reference_model()
    healthy, broken = (
        records(axis_model, seeds, which, samples=SAMPLES, noise=0.0).y[FAULT_AT:] for which in (None, fault)
    )
    return least_delay(healthy, broken, NOISE["speed"] ** 2, samples_between) * INTERVAL_S
