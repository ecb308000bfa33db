"""How the hall is observed and followed: from scripted deviations of the estimates, without any plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from monitor_core.drive import HEAT, AxisModel, Conditions, NominalSchedule, Operating, Term, ThermalModel
from monitor_core.drive.thermal_state import ThermalState
from monitor_core.kernel.state import USED
from monitor_core.modeling import INTERVAL_S
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor, WarmUp
from monitor_core.monitoring.heat_observer import ERROR_LASTS, EXTRAPOLATED, SETTLING_MEMORIES
from monitor_core.monitoring.lane_status import Deviations
from monitor_core.samples import SampleBlock
from monitor_core.settings import Settings
from monitor_core.trend.entries import EstimateReading

MODEL = AxisModel(three_mass("speed"), REFERENCE_VALUES, ("kT", "fm"))
FM = REFERENCE_VALUES["fm"]
SLOPE = -0.01 * FM
"""Of fm, per watt"""
THERMAL = ThermalModel(600.0, 0.05, 0.4, 30.0, "cold", ambient=8.0)
SETTINGS = Settings(INTERVAL_S, lam=1 - INTERVAL_S / 5.0)
LOOK_S = SETTLING_MEMORIES * SETTINGS.memory * INTERVAL_S
ERROR = 0.02 * FM


class Morning:
    """An axis that turns, and whose estimates of fm are off by as much as is said."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, thermal: ThermalModel = THERMAL) -> None:
        follows = NominalSchedule("fm", Term.read(HEAT), SLOPE, 10.0, 0.0, 30.0, margin=math.inf)
        self.operating = Operating(MODEL, Conditions((), (follows,), thermal=thermal))
        self.monitor, self._t_us, self.off = AxisMonitor(MODEL, SETTINGS), 0, 0.0
        self.tolerated = 0.1 * FM
        monkeypatch.setattr(self.monitor, "deviations", self._deviations)
        monkeypatch.setattr(self.monitor, "move_nominal", self._moved)
        self.warm_up = WarmUp(self.operating, self.monitor)

    def _deviations(self) -> Deviations:
        tolerated, errors = np.array([1.0, self.tolerated]), np.array([0.01, ERROR])
        return Deviations(np.array([0.0, self.off]), np.diag([1e-4, (0.01 * FM) ** 2]), tolerated, errors)

    def _moved(self, step: np.ndarray) -> None:
        self.off -= step[1]

    def turn(self, seconds: float, speed: float = 10.0) -> None:
        """Turn for so long; each sample updates theta."""
        t_us = self._t_us + 100_000 * np.arange(round(10 * seconds), dtype=np.int64)
        parts: list[SampleBlock | None] = [SampleBlock(t_us, np.zeros(t_us.size), np.full(t_us.size, speed))]
        while (part := parts.pop()) is not None:
            taken, rest = self.warm_up.part(part)
            parts.append(rest)
            self.monitor.batch.state.counts[USED, 0] += round(0.1 * taken.size / INTERVAL_S)
        self._t_us = int(t_us[-1]) + 100_000

    def after_night(self, off: float) -> None:
        """An evening of motion, and a night after which fm is off by so much."""
        self.turn(2 * LOOK_S)
        self._t_us += round(14 * 3600e6)
        self.off = off

    @property
    def thermal(self) -> ThermalState:
        assert self.operating.thermal is not None
        return self.operating.thermal


def test_after_a_night_the_hall_is_observed_before_anything_is_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Morning(monkeypatch)
    axis.after_night(0.06 * FM)  # of a hall that is colder by 6 W
    axis.turn(0.5 * LOOK_S)
    known = [axis.thermal.known, bool(axis.monitor.batch.judged[0])]
    axis.turn(1.5 * LOOK_S)
    known += [axis.thermal.known, bool(axis.monitor.batch.judged[0])]
    assert known == [False, False, True, True]
    assert axis.thermal.ambient == pytest.approx(-6.0, abs=1.0)
    assert axis.off == pytest.approx(0.0, abs=0.01 * FM)


def test_a_fault_that_came_overnight_is_tested(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond what any hall explains, by three standard deviations: 24 W are 24 % of fm."""
    axis = Morning(monkeypatch)
    axis.after_night(0.5 * FM)
    axis.turn(2 * LOOK_S)
    assert axis.thermal.known
    assert abs(axis.thermal.ambient) < 1e-9
    assert axis.off == 0.5 * FM


def test_a_hall_that_changes_slowly_is_followed_but_not_while_an_alarm_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Morning(monkeypatch)
    axis.turn(2 * LOOK_S)
    for opened in (True, False):
        monkeypatch.setattr(AxisMonitor, "open_alarms", ("an alarm",) if opened else ())
        before = axis.thermal.ambient
        axis.off = 0.03 * FM
        axis.turn(1800.0)
        moved = axis.thermal.ambient - before
        assert moved == 0.0 if opened else moved < -1.5


def test_a_sudden_change_of_friction_is_no_hall(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Morning(monkeypatch)
    axis.turn(1800.0)
    before = axis.thermal.ambient
    axis.off = 0.3 * FM
    axis.turn(1800.0)
    assert axis.thermal.ambient == before


def test_errors_that_last_count_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The standard deviation after a time constant is that of two observations, not of dozens."""
    axis = Morning(monkeypatch)
    axis.turn(THERMAL.tau_s)
    alone = ERROR / abs(SLOPE)
    assert axis.thermal.sd_of_state > 0.8 * alone * math.sqrt(ERROR_LASTS)
    assert axis.thermal.sd_of_state < alone


def test_an_observed_hall_is_less_certain_while_the_axis_warms_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """By half of it from cold to the largest heat; one like that of the records stays certain."""
    sds = list[float]()
    for off in (0.0, -0.12 * FM):
        axis = Morning(monkeypatch, replace(THERMAL, tau_s=60.0))
        axis.after_night(off)
        axis.turn(1.6 * LOOK_S, 0.01)
        assert axis.thermal.known
        assert (axis.thermal.ambient > 8.0) == (off < 0)
        axis.off = 0.0
        axis.turn(2 * LOOK_S, 16.0)
        assert axis.thermal.heat < 30.0
        sds.append(axis.thermal.sd_of_state)
    assert sds[1] > 1.05 * sds[0]


def test_a_restart_in_a_motion_needs_no_new_observation(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was known when it was saved is known, as well as it was."""
    axis = Morning(monkeypatch)
    axis.turn(4 * LOOK_S)
    axis.tolerated = 0.01 * FM
    assert axis.thermal.sd_of_state * abs(SLOPE) > axis.tolerated
    axis.warm_up = WarmUp(axis.operating, axis.monitor)
    axis.turn(1.0)
    assert axis.thermal.known


def test_beyond_the_heat_of_the_records_it_is_never_certain(monkeypatch: pytest.MonkeyPatch) -> None:
    axis = Morning(monkeypatch)
    axis.after_night(0.15 * FM)
    axis.turn(1.6 * LOOK_S, 0.01)
    assert axis.thermal.known
    beyond = -axis.thermal.heat
    assert beyond > 8.0
    assert axis.thermal.sd_of_state >= 0.99 * EXTRAPOLATED * beyond


def test_the_trend_sees_what_is_taken_for_a_hall(monkeypatch: pytest.MonkeyPatch) -> None:
    """Worn friction is 6 % higher, one morning after months: the tests take that for a hall, the trend does not."""
    axis = Morning(monkeypatch)
    axis.after_night(0.06 * FM)
    axis.turn(2 * LOOK_S)
    left = (1.0, FM + axis.off)
    reading = EstimateReading(0, left, (0.0, 0.0), (True, True), 1.0, 0.0)
    (converted,) = axis.warm_up.for_trend([reading])
    assert converted.value == pytest.approx((1.0, 1.06 * FM), rel=0.005)
    assert converted._replace(value=left) == reading
