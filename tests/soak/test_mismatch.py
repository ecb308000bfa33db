"""Twenty axes that are not what their models say: ten hours each without a false alarm, and their faults are named.

Five masses with what real axes have beside them (tests/core/mismatch_plant.py), all values redrawn by 20 %; the
monitor has three, and was commissioned by ``identify`` and ``calibrate`` from a minute of excitation and ten minutes of
healthy motion, five of them cold and five warm.

Measured (seeds 11, 2842059353, 4232056448): no false alarm in 200 h each; all of 180 faults named right in time, kT
after at most 32, 33 and 31 s, fc 70, 71 and 65 s, of which the axis moved for less than 60, fm 40, 36 and 41 s.  On
many of the plants ``identify`` refused some step, or said that it cannot tell all masses; then the steps go on with
what the one before found.

In other 200 h (seed 1) there was one, of fc on plant 14 after 9.4 h: no drift, but a record whose mean was off by 2.2
standard deviations, and chance again.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from monitor_core.arrays import Floats
from tests.core.mismatch_plant import MismatchPlant, redrawn
from tests.core.mismatch_watch import FAULTS, FaultAlarm, after_fault, right
from tests.soak.mismatched import PARAMETERS, RefusedError, commissioned, watch_of

pytestmark = pytest.mark.soak

PLANTS, HOURS, BLOCK_S = 20, 10.0, 600.0
LEAST = {"kT": 1.0, "fc": 0.95, "fm": 1.0}
"""Share named right in time; fc comes close to a minute on some plants."""
ONSETS_H = (0.5, 1.5, 9.5)
"""In the warm-up, and warm."""


class Watched(NamedTuple):
    """Of one plant: false alarms as (hour, parameter), faults as (parameter, alarm or None), theta's deviations."""

    plant: int
    false: Sequence[tuple[float, str]]
    found: Sequence[tuple[str, FaultAlarm | None]]
    mean: Floats  # (p,)
    sd: Floats  # (p,)


def watched(number: int, seed: int, folder: Path, hours: float = HOURS) -> Watched:
    """Commission it on one day, and start it cold on another."""
    truth = redrawn(np.random.default_rng([seed, number]))
    path = commissioned(MismatchPlant(truth, np.random.default_rng([seed, number, 1])), folder, seed + number)
    plant, watch = MismatchPlant(truth, np.random.default_rng([seed, number, 2])), watch_of(path)
    false: dict[tuple[int, tuple[str, str]], tuple[float, str]] = {}
    found, off = [], []
    for k in range(round(hours * 3600 / BLOCK_S)):
        hour = k * BLOCK_S / 3600
        if any(hour - BLOCK_S / 3600 < at <= hour for at in ONSETS_H):
            found += [(name, after_fault(plant, watch, {name: f}, s)) for name, (f, s) in FAULTS.items()]
        episodes, d = watch.take(plant.take(BLOCK_S))
        false |= {(e.raised_us, e.first): (e.raised_us / 3.6e9, e.parameter) for e in episodes}
        off.append(d[::20])
    d = np.concatenate(off[1:])
    return Watched(number, list(false.values()), found, d.mean(axis=0), d.std(axis=0))


def printed(one: Watched) -> None:
    said = " ".join(
        f"{name} {100 * m:+.1f} +/- {100 * s:.1f} %"
        for name, m, s in zip(PARAMETERS, one.mean, one.sd, strict=True)
    )
    print(f"\nplant {one.plant}: theta {said}; {len(one.false)} false {one.false[:5]}")
    for name, alarm in one.found:
        what = (
            "not named"
            if alarm is None
            else (
                f"raised as {alarm.first} after {alarm.raised_s:.1f} s, named {alarm.parameter} {alarm.direction}"
                f" {100 * alarm.size:+.0f} % after {alarm.named_s:.0f} s"
            )
        )
        print(f"   {name}: {what}{'' if right(name, alarm) else '   WRONG'}", flush=True)


def test_twenty_plants(seed: int, tmp_path: Path) -> None:
    plants, refused = [], []
    for number in range(PLANTS):
        (tmp_path / str(number)).mkdir()
        try:
            plants.append(watched(number, seed, tmp_path / str(number)))
        except RefusedError as error:
            refused.append(number)
            print(f"\nplant {number}: {error}", flush=True)
        else:
            printed(plants[-1])
    hours = len(plants) * HOURS
    noisy = [one for one in plants if one.false]
    print(
        f"\n{sum(len(one.false) for one in noisy)} false alarms in {hours:.0f} h, in {len(noisy)} of {len(plants)}"
        f" plants; refused {refused}"
    )
    for name, (factor, seconds) in FAULTS.items():
        alarms = [alarm for one in plants for of, alarm in one.found if of == name]
        good = [alarm for alarm in alarms if alarm is not None and right(name, alarm)]
        delay = np.median([alarm.named_s for alarm in good])
        size = np.median([alarm.size for alarm in good])
        wrong = sum(alarm is not None for alarm in alarms) - len(good)
        print(
            f"{name} x {factor}: named right within {seconds:.0f} s of motion in {len(good)} of {len(alarms)}, after"
            f" {delay:.0f} s, size {100 * size:+.0f} % (medians); wrong name {wrong}"
        )
    assert not noisy
    assert not refused
    for name in FAULTS:
        told = [right(of, alarm) for one in plants for of, alarm in one.found if of == name]
        assert np.mean(told) >= LEAST[name]
