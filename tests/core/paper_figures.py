"""The paper's detector on the reference experiment: thresholds for a rate of false alarms, alarms in two stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monitor_core.calibration.budget import rates, thresholds
from monitor_core.calibration.healthy_records import deviations
from monitor_core.calibration.healthy_statistics import healthy_statistics
from monitor_core.drive.axis_model import AxisModel
from monitor_core.excitation.reference_experiment import FAULT_AT
from monitor_core.modeling.standard_drives import INTERVAL_S
from monitor_core.monitoring import AxisBatch, AxisMonitor
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from tests.core.figures import AT_ONCE
from tests.core.hypothesis_figures import WATCHED, WITHIN_S, Delays, One, records, summed_up

HEALTHY = 120_000
"""Samples of the record from which thresholds come: ten minutes."""
WITHIN = 3.0
"""Memories in which the smallest fault is to be found."""


def calibrated(model: AxisModel, settings: Settings, seed: int, between: float) -> tuple[Settings, str]:
    """With the thresholds that most likely alarm once in so many samples of the healthy axis; and how that is known."""
    rng = np.random.default_rng([seed, 1])
    t_us, u, y = records(model, [seed], samples=HEALTHY)
    one = [SampleBlock(t_us, u[:, 0], y[:, 0], name="healthy")]
    known = healthy_statistics(model, settings, one, deviations(model, settings, one), between, WITHIN, rng)
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


def paper_delays(
    model: AxisModel, settings: Settings, fault: Mapping[str, float], seeds: Sequence[int]
) -> Delays:
    """The first alarm, its first name, and the one that it gets three memory lengths later."""
    (right,) = fault
    found = [
        one
        for k in range(0, len(seeds), AT_ONCE)
        for one in _outcomes(model, settings, fault, seeds[k : k + AT_ONCE])
    ]
    return summed_up(found, right)


def _outcomes(
    model: AxisModel, settings: Settings, fault: Mapping[str, float], seeds: Sequence[int]
) -> list[One]:
    t_us, u, y = records(model, seeds, fault)
    W = len(seeds)
    bank = AxisBatch([model] * W, [settings] * W)
    monitors = [AxisMonitor.of_lane(bank, a) for a in range(W)]
    found = [One() for _ in range(W)]
    for a, event in bank.run(np.repeat(t_us[:, np.newaxis], W, axis=1), u, y):
        for _, e in monitors[a].apply([event]):
            delay = (e.raised_us - int(t_us[FAULT_AT])) * 1e-6 + INTERVAL_S
            if found[a].early or delay > WITHIN_S:
                continue
            if delay <= 0:
                found[a] = One(early=True)
            elif not found[a].cause:
                found[a] = One(alarm=delay, cause=e.parameter)
            if e.stage == "named" and not found[a].name and not found[a].early:
                when = (e.updated_us - int(t_us[FAULT_AT])) * 1e-6 + INTERVAL_S
                found[a] = found[a]._replace(named=when, name=e.parameter)
    assert len(t_us) == WATCHED
    return found
