"""The reference experiment seen by the bank of hypotheses: how fast, and how often named right."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.detection.bank import HypothesisBank
from monitor_core.detection.events import Changed, Named
from monitor_core.detection.limit import least_delay
from monitor_core.kernel.tables import Floats
from monitor_core.model import Output
from monitor_core.reference import (
    FAULT_AT,
    INTERVAL_S,
    MONITORED,
    NOISE,
    SAMPLES,
    Record,
    experiment,
    experiments,
    reference_model,
)
from monitor_core.settings import Settings
from tests.core.figures import AT_ONCE, run_bank, settings_of

BLOCK = 100
DAY = 86400 / INTERVAL_S
LEFT_S = (SAMPLES - FAULT_AT) * INTERVAL_S


def bank_of(output: Output, h: float, seed: int) -> HypothesisBank:
    return HypothesisBank(reference_model(output), settings_of(output, seed), h=h)


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


class _One(NamedTuple):
    alarm: float = math.inf
    cause: str = ""
    named: float = math.inf
    name: str = ""
    early: bool = False
    certain: bool = True


def delays(bank: HypothesisBank, fault: Mapping[str, float], seeds: Sequence[int]) -> Delays:
    """Of those that alarm and are named, before the record's end, which share has the right cause."""
    (right,) = fault
    found: list[_One] = []
    for k in range(0, len(seeds), AT_ONCE):
        records = experiments(seeds[k : k + AT_ONCE], fault, output=bank.model.drive.output)
        found += [
            _run(bank, Record(records.t_us, records.u[:, a], records.y[:, a]))
            for a in range(records.u.shape[1])
        ]
    alarmed, named = [one for one in found if one.cause], [one for one in found if one.name]
    return Delays(
        np.array([one.alarm for one in found]),
        np.array([one.named for one in found]),
        float(np.mean([one.cause == right for one in alarmed])),
        float(np.mean([one.name == right for one in named])),
        sum(one.early for one in found),
        sum(not one.certain for one in found),
    )


def _run(bank: HypothesisBank, rec: Record) -> _One:
    bank.reset()
    one = _One()
    for at in range(0, len(rec.u), BLOCK):
        block = slice(at, at + BLOCK)
        for event in bank.run(rec.t_us[block], rec.u[block], rec.y[block]):
            delay = (event.time_us - rec.t_us[FAULT_AT]) * 1e-6 + INTERVAL_S
            if isinstance(event, Changed) and delay <= 0:
                return one._replace(early=True)
            if isinstance(event, Changed):
                one = one._replace(alarm=delay, cause=event.shares[0].cause)
            elif isinstance(event, Named):
                return one._replace(named=delay, name=event.shares[0].cause, certain=event.certain)
    return one


def false_alarms(bank: HypothesisBank, seed: int, samples: int) -> tuple[int, int]:
    """Alarms of a healthy record, and samples tested; after each alarm the bank begins anew."""
    rec = experiment(seed, samples=samples, fault_at=samples // 2, output=bank.model.drive.output)
    at, alarms, settling = 0, 0, round(bank.settings.settle_s / INTERVAL_S)
    begun = 0
    while at < samples:
        bank.reset()
        begun += 1
        at = _until_alarm(bank, rec, at)
        alarms += at < samples
    return alarms, samples - begun * settling


def _until_alarm(bank: HypothesisBank, rec: Record, at: int) -> int:
    while at < len(rec.u):
        block = slice(at, at + 20 * BLOCK)
        events = bank.run(rec.t_us[block], rec.u[block], rec.y[block])
        if events:
            return int(np.searchsorted(rec.t_us, events[0].time_us)) + 1
        at += 20 * BLOCK
    return len(rec.u)


def within(delay: Floats) -> tuple[float, float]:
    """Median and 90 % quantile of delays that may be infinite."""
    median, most = np.quantile(delay, [0.5, 0.9], method="higher")
    return float(median), float(most)


def limit_s(fault: Mapping[str, float], seeds: Sequence[int], samples_between: float) -> float:
    """The limit for a fault of the reference experiment, over the records of these seeds."""
    healthy, broken = (experiments(seeds, which, noise=0.0).y[FAULT_AT:] for which in (None, fault))
    return least_delay(healthy, broken, NOISE["speed"] ** 2, samples_between) * INTERVAL_S


def paper_delays(settings: Settings, fault: Mapping[str, float], seeds: Sequence[int]) -> Delays:
    """The paper's detector: first crossing of any g; named by the largest |d| / sd three memory lengths later."""
    (right,) = fault
    parts = [
        _paper(settings, fault, seeds[k : k + AT_ONCE], MONITORED.index(right))
        for k in range(0, len(seeds), AT_ONCE)
    ]
    alarm, first, named, early = (np.concatenate(of) for of in zip(*parts, strict=True))
    alarmed = np.isfinite(alarm)
    later = np.where(alarmed, alarm + 3 * settings.memory * INTERVAL_S, np.inf)
    return Delays(
        alarm, later, float(first[alarmed].mean()), float(named[alarmed].mean()), int(early.sum()), 0
    )


def _paper(
    settings: Settings, fault: Mapping[str, float], seeds: Sequence[int], which: int
) -> tuple[Floats, ...]:
    """For each seed: delay [s], whether the right parameter was first, is largest later, and an early alarm."""
    model = reference_model()
    trace = run_bank(model, settings, seeds, fault)
    crossed = np.any(trace.g > settings.alpha2 * model.scale[:, np.newaxis], axis=1)
    early, late = crossed[:FAULT_AT].any(axis=(0, 1)), crossed[FAULT_AT:]
    when = np.where(late.any(axis=0), late.argmax(axis=0), SAMPLES)  # (p, seeds)
    first, lane = when.min(axis=0), np.arange(len(seeds))
    look = np.minimum(FAULT_AT + first + round(3 * settings.memory), SAMPLES - 1)
    d = abs(trace.theta - model.theta0[:, np.newaxis]) / np.sqrt(trace.P)
    alarm = np.where((first < SAMPLES) & ~early, (first + 1) * INTERVAL_S, np.inf)
    return (
        alarm,
        (when.argmin(axis=0) == which) * 1.0,
        (d[look, :, lane].argmax(axis=1) == which) * 1.0,
        early * 1.0,
    )
