"""An alarm says that heat may be its cause, where the records do not show how friction follows the heat."""

from dataclasses import replace

import numpy as np
import pytest

from monitor_core.detection import Alarm
from monitor_core.excitation import multisine
from monitor_core.excitation.reference_experiment import BAND_HZ, NOISE, TORQUE_RMS, faulty
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, three_mass
from monitor_core.monitoring import AxisMonitor, NotTested, UnrecordedHeat
from monitor_core.monitoring.unrecorded_heat import OTHER_HEAT, WAIT_S, WARMER
from monitor_core.samples import SampleBlock
from tests.core.simulated import simulated
from tests.core.supervised import MODEL, SUPERVISED, H

SETTINGS = replace(SUPERVISED, lam=0.995, alpha1=1.0, alpha2=30.0)
NIGHT_S = 8 * 3600.0


class Watched:
    """An axis that moves and rests, and its monitor."""

    def __init__(self, seed: int, waits: bool = False) -> None:
        self._rng, self._at_us = np.random.default_rng(seed), 0
        self._waits = waits
        self.monitor = AxisMonitor(MODEL, SETTINGS)
        self.heat = UnrecordedHeat(self.monitor, waits)

    def take(
        self, seconds: float, pause_s: float = 1.0, rest_s: float = 0.0, size: int = 100_000, **fault: float
    ) -> list[Alarm]:
        """Open alarms after a pause without samples, motion, and rest; parameters are times the factors of ``fault``.

        The monitor gets blocks of ``size`` samples.
        """
        u = np.zeros(round((seconds + rest_s) / H))
        if seconds:
            u[: round(seconds / H)] = multisine(self._rng, round(seconds / H), H, BAND_HZ, TORQUE_RMS)
        values = faulty(REFERENCE_VALUES, fault)
        rec = simulated(self._rng, three_mass("speed"), u, output_noise=NOISE["speed"], values=values)
        self._at_us += round(pause_s * 1e6)
        samples = SampleBlock(rec.t_us + self._at_us, rec.u, rec.y)
        self._at_us += round((seconds + rest_s) * 1e6)
        for first in range(0, samples.size, size):
            self._feed(samples.select(slice(first, first + size)))
        return list(self.monitor.open_alarms)

    def restart(self, is_saved: bool = True) -> None:
        """Go on from the saved state and the open alarms, in the order of the daemon."""
        saved, alarms = self.monitor.to_arrays(), self.monitor.open_alarms
        starts = self.heat.to_arrays()
        self.monitor = AxisMonitor(MODEL, SETTINGS)
        self.heat = UnrecordedHeat(self.monitor, self._waits)
        self.monitor.from_arrays(saved)
        if is_saved and starts is not None:
            self.heat.from_arrays(starts)
        self.monitor.adopt(alarms)

    def _feed(self, rest: SampleBlock | None) -> None:
        while rest is not None:
            part, rest = self.heat.part(rest)
            self.monitor.update(part)


def other_causes(alarms: list[Alarm]) -> dict[str, tuple[str, ...]]:
    """Other causes of the named parameter, for each alarm."""
    return {a.parameter: next(c.alike for c in a.causes if c.parameter == a.parameter) for a in alarms}


def test_friction_that_is_off_at_the_first_motion_may_be_heat(seed: int) -> None:
    for factor in (1.5, 0.6):
        assert other_causes(Watched(seed).take(60.0, fm=factor)) == {"fm": (OTHER_HEAT,)}, factor


def test_kt_that_is_off_at_the_first_motion_is_no_heat(seed: int) -> None:
    assert other_causes(Watched(seed).take(60.0, kT=0.8))["kT"] == ()


def test_a_change_while_the_axis_works_is_no_heat(seed: int) -> None:
    axis = Watched(seed)
    assert not axis.take(60.0)
    assert other_causes(axis.take(40.0, fm=1.5)) == {"fm": ()}
    assert other_causes(axis.take(60.0, NIGHT_S, fm=1.5)) == {"fm": ()}


def test_heat_is_a_possible_cause_after_a_long_pause_only(seed: int) -> None:
    for pause_s, causes in ((900.0, (OTHER_HEAT,)), (300.0, ())):
        axis = Watched(seed)
        assert not axis.take(60.0)
        assert other_causes(axis.take(60.0, pause_s, fm=1.5)) == {"fm": causes}, pause_s


def test_an_axis_that_stands_while_samples_come_has_a_pause(seed: int) -> None:
    for rest_s, causes in ((900.0, (OTHER_HEAT,)), (300.0, ())):
        axis = Watched(seed)
        assert not axis.take(60.0, rest_s=rest_s)
        assert other_causes(axis.take(60.0, fm=1.5)) == {"fm": causes}, rest_s


def test_friction_that_falls_slowly_in_the_first_hours_may_be_heat(seed: int) -> None:
    axis = Watched(seed)
    assert not axis.take(60.0)
    (changed,) = axis.take(60.0, fm=0.6)
    falls = replace(changed, kind="drift")
    assert axis.heat.look_alike(falls) == {"fm": WARMER, "fc": WARMER}
    hours_later = {name: getattr(falls, name) + 3 * 3_600_000_000 for name in ("onset_us", "raised_us")}
    assert axis.heat.look_alike(replace(falls, onset_low_us=None, **hours_later)) == {}
    assert axis.heat.look_alike(replace(falls, direction="up")) == {}


def test_the_other_cause_stays_with_the_alarm_over_later_starts_and_restarts(seed: int) -> None:
    axis = Watched(seed)
    axis.take(60.0, fm=1.5)
    assert other_causes(axis.take(60.0, NIGHT_S, fm=1.5)) == {"fm": (OTHER_HEAT,)}
    axis.restart()
    assert other_causes(axis.take(60.0, fm=1.7)) == {"fm": (OTHER_HEAT,)}


@pytest.mark.parametrize("is_saved", [True, False])
def test_a_restart_of_seconds_is_no_start_of_the_motion(seed: int, is_saved: bool) -> None:
    """Also with a checkpoint of a version that did not save the starts."""
    for pause_s, causes in ((5.0, ()), (NIGHT_S, (OTHER_HEAT,))):
        axis = Watched(seed)
        assert not axis.take(60.0)
        axis.restart(is_saved)
        assert other_causes(axis.take(60.0, pause_s, fm=1.5)) == {"fm": causes}, pause_s


def test_a_standstill_goes_on_over_a_restart(seed: int) -> None:
    """Five minutes at rest, a restart, and six more are a pause; the axis then waits from its end."""
    axis = Watched(seed, waits=True)
    axis.take(WAIT_S + 60.0, rest_s=300.0)
    assert not axis.monitor.status().waits
    axis.restart()
    axis.take(0.0, rest_s=360.0)
    axis.restart()
    axis.take(10.0)
    assert axis.monitor.status().judged_in_s == pytest.approx(WAIT_S - 10.0, abs=15.0)


def test_the_time_of_an_axis_that_waits_goes_on_over_a_restart(seed: int) -> None:
    axis = Watched(seed, waits=True)
    axis.take(1500.0)
    axis.restart()
    axis.take(100.0)
    assert axis.monitor.status().judged_in_s == pytest.approx(WAIT_S - 1600.0, abs=15.0)


def test_what_is_no_saved_start_is_refused() -> None:
    saved = {"starts": np.array([5]), "moved": np.array([7, 0])}
    Watched(0).heat.from_arrays(saved)
    for name, array in (
        ("starts", np.array([[5]])),
        ("moved", np.array([7])),
        ("moved", np.array([7.0, 0.0])),
    ):
        with pytest.raises(ValueError, match="no starts of a motion"):
            Watched(0).heat.from_arrays({**saved, name: array})


def test_an_axis_that_waits_is_tested_an_hour_after_each_start(seed: int) -> None:
    axis = Watched(seed, waits=True)
    assert not axis.take(1500.0, fm=1.5)
    status = axis.monitor.status()
    assert (status.waits, list(status.untested_so_far())) == (True, [NotTested.WARM_UP])
    assert status.judged_in_s == pytest.approx(WAIT_S - 1500.0, abs=15.0)
    assert not axis.take(10.0, rest_s=900.0, fm=1.5)
    assert not axis.take(3500.0, fm=1.5)
    assert axis.take(200.0, fm=1.5)
    assert not axis.monitor.status().waits


def test_any_cut_of_the_samples_gives_the_same(seed: int) -> None:
    at_once, cut = Watched(seed), Watched(seed)
    alarms = at_once.take(60.0, fm=1.5)
    assert alarms
    assert cut.take(60.0, size=37, fm=1.5) == alarms
    assert cut.monitor.status() == at_once.monitor.status()
