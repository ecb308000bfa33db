"""Friction follows a measured temperature where the records show it, and otherwise the heat of the axis, or nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.arrays import Floats
from monitor_core.drive.thermal_state import TEMPERATURE
from monitor_core.identification import IdentificationOptions, IdentificationResult, identify
from monitor_core.identification.greybox import Estimate, fit
from monitor_core.identification.problem import Problem
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.thermal import warmed_fit
from monitor_core.identification.thermal.measured_temperature import following_temperature, is_of_the_gear
from monitor_core.identification.thermal.temperature_source import follows_motion, temperature_courses
from monitor_core.modeling.standard_drives import three_mass
from tests.core.mismatch_monitor import FOUND
from tests.core.warming import Warming, WarmingPlant

QUICK = Warming(fast_s=60.0, slow_s=150.0)
STEADY = Warming(fm=0.0, fc=0.0, stribeck=0.0)
FOLLOWERS = ("fm", "fc")
SECONDS, STEP_S = 300.0, 5.0
_BREAK = 24
"""Step at which a break begins"""

Thermometer = Callable[[float, float], float]
"""Temperature for the warmth of the gearbox, and the time since the start [s]"""


def of_gearbox(warmth: float, _since: float) -> float:
    return round(22.0 + 30.0 * warmth)  # whole degrees, as many drives send


def of_winding(_warmth: float, since: float) -> float:
    return 60.0 - 38.0 * float(np.exp(-since / 8.0))


def of_hall(warmth: float, _since: float) -> float:
    """It rises by one degree meanwhile, in tenths."""
    return round(20.0 + warmth, 1)


def warmer(warmth: float, _since: float) -> float:
    """On a day when what it is of is warmer, and the gearbox is not."""
    return of_gearbox(warmth, 0.0) + 40.0


def constant(_warmth: float, _since: float) -> float:
    return 30.0


class Lagging:
    """A thermometer on the housing, in whole degrees: it follows the gearbox with a time constant of its own [s]."""

    def __init__(self, lag_s: float) -> None:
        self._kept, self._shown = float(np.exp(-STEP_S / lag_s)), 22.0

    def __call__(self, warmth: float, _since: float) -> float:
        self._shown += (1 - self._kept) * (22.0 + 30.0 * warmth - self._shown)
        return round(self._shown)


def of_cabinet(_warmth: float, since: float) -> float:
    """It becomes warm after it has been switched on, in whole degrees."""
    return round(22.0 + 20.0 * (1 - float(np.exp(-since / 150.0))))


def recorded(seed: int, warming: Warming, thermometer: Thermometer, pause_s: float = 0.0) -> Record:
    """A record from cold on, with the temperature as a signal; ``pause_s``: of a break."""
    plant = WarmingPlant(np.random.default_rng(seed), warming=warming)
    blocks, temperatures = [], list[Floats]()
    for k in range(round(SECONDS / STEP_S)):
        now = thermometer(plant.warmth, k * STEP_S)
        if pause_s and k == _BREAK:
            plant.pause(pause_s)
        blocks.append(plant.take(STEP_S))
        temperatures.append(np.full(blocks[-1].u.size, now))
    t, u, y = (np.concatenate([getattr(block, name) for block in blocks]) for name in ("t_us", "u", "y"))
    signals = {TEMPERATURE: np.concatenate(temperatures)}
    return Record(np.asarray(t * 1e-6, np.float64), u, y, "angle", "cold", signals=signals)


def identified(record: Record, *validation: Record) -> IdentificationResult:
    options = IdentificationOptions("values", monitored=FOLLOWERS, thermal="cold", begins_s=(0.0,))
    return identify(Problem(three_mass("angle"), FOUND, FOLLOWERS), [record], validation, options)


def refit(problem: Problem, records: Sequence[Record]) -> Estimate:
    return fit(problem, records, most_iterations=15)


def followed(*records: Record) -> list[str]:
    """The parameters that follow the temperature."""
    before = refit(Problem(three_mass("angle"), FOUND, FOLLOWERS), records)
    found = following_temperature(before, records, FOLLOWERS, refit)
    return [] if found is None else [term.parameter for term in found.terms]


def test_friction_follows_the_temperature_of_the_gearbox(seed: int) -> None:
    found = identified(recorded(seed, QUICK, of_gearbox), recorded(seed + 1, QUICK, of_gearbox))
    assert found.warm_up is None
    own, other = (float(np.std(r.y - r.predicted)) for r in (*found.estimation, *found.validation))
    assert other == pytest.approx(own, rel=0.3)
    terms = {s.parameter: s for s in found.options.scheduled}
    assert "fm" in terms
    assert {s.term for s in terms.values()} == {TEMPERATURE}
    assert not {*found.not_following} & {*terms}
    slope = dict(zip(found.estimate.names, found.estimate.theta.tolist(), strict=True))[f"fm per {TEMPERATURE}"]
    warmest = terms["fm"].high
    cold, warm = (found.estimate.values["fm"] + slope * (x - terms["fm"].reference) for x in (22.0, warmest))
    assert warm / cold == pytest.approx(np.exp(-QUICK.fm * (warmest - 22.0) / 30.0), abs=0.1)


def test_friction_follows_a_thermometer_that_lags_rather_than_the_heat(seed: int) -> None:
    """In one record the heat explains more, but it would not know a hall of another temperature."""
    found = identified(recorded(seed, QUICK, Lagging(60.0)))
    assert found.warm_up is None
    assert found.temperature_share is not None
    assert 0.5 < found.temperature_share < 0.97
    terms = {s.parameter for s in found.options.scheduled if s.term == TEMPERATURE}
    assert "fm" in terms
    assert found.temperature_errors.keys() == terms
    assert all(error > 0 for error in found.temperature_errors.values())


def test_friction_follows_the_heat_where_the_temperature_is_of_something_else(seed: int) -> None:
    found = identified(recorded(seed, QUICK, of_winding))
    assert found.warm_up is not None
    assert found.temperature_errors == {}
    assert TEMPERATURE not in {s.term for s in found.options.scheduled}


@pytest.mark.parametrize(("thermometer", "expected"), [(of_gearbox, True), (Lagging(60.0), True), (of_cabinet, False)])
def test_a_break_shows_whether_it_follows_the_motion(thermometer: Thermometer, expected: bool, seed: int) -> None:
    record = recorded(seed, QUICK, thermometer, pause_s=90.0)
    found = refit(Problem(three_mass("angle"), FOUND, FOLLOWERS), [record])
    assert follows_motion(temperature_courses(found, [record]), True) is expected


def test_friction_follows_what_does_not_follow_the_motion_only_if_that_explains_more(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warmed_fit, "follows_motion", lambda _courses, _begins_cold: False)
    found = identified(recorded(seed, QUICK, Lagging(60.0)))
    assert found.temperature_share is not None
    assert found.temperature_share > 0.5
    assert found.temperature_follows_motion is False
    assert found.warm_up is not None
    assert is_of_the_gear(1.1, False)  # as where it is the hall that warms an axis


def test_a_temperature_that_another_day_refutes_is_left_aside(seed: int) -> None:
    """On each day alone friction falls as it rises; the line through both days still falls, by much less."""
    first, *others = (recorded(seed + k, QUICK, who) for k, who in enumerate((of_gearbox, of_gearbox, warmer)))
    assert "fm" in followed(first, others[0])
    assert "fm" in followed(others[1])
    assert followed(first, others[1]) == []


def test_what_does_not_show_that_friction_follows(seed: int) -> None:
    assert followed(recorded(seed, STEADY, of_gearbox)) == []
    assert followed(recorded(seed, QUICK, constant)) == []
    assert followed(recorded(seed, QUICK, of_hall)) == []
    without = recorded(seed, QUICK, of_gearbox)
    assert followed(replace(without, signals={})) == []
    rising = replace(QUICK, fm=-0.2, fc=-0.1, stribeck=0.0)
    assert followed(recorded(seed, rising, of_gearbox)) == []
