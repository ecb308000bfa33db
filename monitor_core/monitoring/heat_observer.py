"""Observes the heat of an axis from its estimates, where nothing else determines it (``drive.thermal_state``).

After a start, or a pause of which nothing is known, the heat is uncertain by its whole range, and after a night the
surroundings may be colder or warmer.  Meanwhile the axis is estimated, but not tested.  Both heats x = (by friction,
ambient) with the covariance P are corrected as by a Kalman filter, from the deviation d of the estimates, their
covariance C and the slopes s of the nominal values over the heat,

    d = s h' x + noise,   h = (1, 1)',   M = C + diag(error^2),   r = 1 / (s' M^-1 s),   z = r s' M^-1 d,
    x <- x + P h z / (h' P h + r),   P <- P - P h h' P / (h' P h + r),

where ``error`` is the standard deviation by which healthy estimates are off beside their scatter, until the remaining
uncertainty moves no nominal value by more than a share of the deviation that the tests tolerate.  Only the parameters
that depend on the heat are used, so a change of another parameter does not affect it.  A change of friction that is
already present cannot be distinguished from heat, unless it is larger than the effect of any heat.  If all of these
parameters but one agree on a heat, that one has changed by a fault, and the others determine the heat; if no heat
explains them so, the uncertainty only decays.

While the axis is tested, the ambient heat is followed in the same way: the heat by friction converges to the same
value whatever it was, and only then the surroundings show, and a hall warms up in some hours.  Its covariance then
allows for no more than that, so that a change within minutes is no ambient heat.  As the errors of healthy estimates
last, observations in a row are not independent.  While an alarm is open nothing is followed.

The tests also tolerate the error of the thermal model (``Settings.model_error``), and the change of the nominal values
if the heat is off by its standard deviation, as after a pause.  Beyond the heat of the records, where the straight
lines are extrapolated, the tests also tolerate the whole extrapolated change.
"""

import copy
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.operating_conditions import Conditions, Operating
from monitor_core.drive.thermal_state import GAP_S, HEAT, ThermalState
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.lane_status import Deviations
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings
from monitor_core.trend.entries import EstimateReading

LOOKS_PER_MEMORY = 2
"""Number of checks per memory whether the heat can be observed."""
SETTLING_MEMORIES = 4
"""Memories of motion until the estimates belong to the present heat."""
MAX_SHARE = 0.5
"""Share of the tolerated deviation by which the uncertainty of the heat may move a nominal value."""
MAX_SIGMAS = 3.0
"""Limit in standard deviations: friction that is farther from any value that heat explains has changed by a fault."""
ERROR_LASTS = 0.5
"""The error of healthy estimates beside their scatter is about the same for this share of the time constant."""
EXTRAPOLATED = 0.5
"""Standard deviation of a heat beyond the range of the records, as a share of what it is beyond: lines are no law."""
CURVED = 0.5
"""Share by which the effect of the hall on friction may change while the axis warms up by the largest heat: friction
falls more steeply while it is cold."""
LOOKS_ALIKE = "a warmer or colder gearbox"
"""Other possible cause, in alarms, of a change of a parameter that depends on the heat"""
_SLOPE_STEP = 1e-3
"""Step for slopes, as a share of the largest heat."""


class HeatCorrection(NamedTuple):
    """What an observation corrects."""

    step: Floats
    """(2,) of the heat by friction and of the ambient heat [W]"""
    covariance: Floats
    """(2, 2) of their errors afterwards [W^2]"""


class WarmUp:
    """Splits the samples of an axis into parts, so that the heat is observed at times that depend on the samples only.

    Args:
        operating: the conditions of the axis, with a thermal model.
        monitor: the monitor that gets the samples.

    Raises:
        ValueError: there is no thermal model.
    """

    def __init__(self, operating: Operating, monitor: AxisMonitor) -> None:
        if operating.thermal is None:
            raise ValueError("these conditions have no thermal model")
        self._operating, self._monitor = operating, monitor
        self._thermal: ThermalState = operating.thermal
        following = dict.fromkeys(operating.following(HEAT), LOOKS_ALIKE)
        monitor.look_alike = lambda _: following
        s = monitor.settings
        self._every_us = max(1, round(1e6 * s.memory * s.interval_s / LOOKS_PER_MEMORY))
        self._needed = round(SETTLING_MEMORIES * s.memory)
        self._widen_us = self._every_us * LOOKS_PER_MEMORY * SETTLING_MEMORIES
        self._since_us: int | None = None  # time at which the heat became unknown
        self._learned = 0  # number of learned samples at that time, or at the last observation
        self._by_friction = 0.0  # heat by friction at that time [W]
        self._tried = False  # whether an observation has been tried since the heat became unknown
        self._last_us: int | None = None
        self.widened = ""
        """A sentence if the heat is far beyond that of the records, so that friction has a wider allowance"""

    def part(self, block: SampleBlock) -> tuple[SampleBlock, SampleBlock | None]:
        """The next part of a block for the monitor, with its conditions; and the remaining samples, or None.

        The monitor must take the part before the next call.
        """
        if not block.size:
            return self._operating.conditioned(block), None
        now_us = int(block.t_us[0])
        self._look(now_us)
        if self._last_us is None or self._last_us // self._widen_us != now_us // self._widen_us:
            self._follow()
            self._allow()
        n = self._part_size(block)
        taken = self._operating.conditioned(block.select(slice(n)))
        self._last_us = int(block.t_us[n - 1])
        if self._thermal.since_us != self._since_us:
            # A heat that was known when it was saved has been observed, if there was no pause since.
            saved = self._since_us is None and self._thermal.known and self._thermal.since_us != now_us
            if self._since_us is None:
                self._by_friction = self._thermal.model.mean(self._thermal.parts)
            self._since_us, self._learned, self._tried = self._thermal.since_us, self._monitor.learned, saved
            self._monitor.judged_us = None
            self._allow(doubt=False)
            if self._thermal.known and (found := self._monitor.deviations()) is not None:
                self._thermal.known = self._wait_s(self._thermal.covariance, found) == 0.0
            self._allow()
        self._monitor.judge(self._thermal.known)
        return taken, block.select(slice(n, None)) if n < block.size else None

    def for_trend(self, readings: Iterable[EstimateReading]) -> list[EstimateReading]:
        """Readings for the long-term trend, converted to the hall of the records.

        Wear makes friction change as slowly as a hall does, and is taken for one.  So the observed hall is not
        subtracted here: over weeks halls are scatter, and wear is not.
        """
        heat = self._thermal.heat
        hall = self._operating.shift_at_heat(heat) - self._operating.shift_at_heat(heat - self._thermal.ambient)
        step = np.where(np.isfinite(hall), hall, 0.0)
        return [reading._replace(value=tuple((reading.value + step).tolist())) for reading in readings]

    def _part_size(self, block: SampleBlock) -> int:
        """Number of samples until the next observation of the heat, or until a pause."""
        if self._last_us is None or abs(int(block.t_us[0]) - self._last_us) > GAP_S * 1e6:
            return 1
        n, now_us = self._operating.samples_before_pause(block.t_us), int(block.t_us[0])
        due_us = (now_us // self._widen_us + 1) * self._widen_us
        if not self._thermal.known:
            due_us = min(due_us, self._next_look(now_us))
        due = np.flatnonzero(block.t_us[:n] >= due_us)
        return int(due[0]) if due.size else n

    def _allow(self, doubt: bool = True) -> None:
        """Set the deviation that the tests tolerate now, beyond the heat of the records and for an uncertain heat."""
        self.widened, more = self._operating.far_beyond, np.abs(self._operating.shift_beyond())
        if doubt and self._thermal.known:
            more = more + np.abs(self._slopes()) * self._thermal.sd_of_state
        self._monitor.allow(more, bool(self.widened))

    def _next_look(self, now_us: int) -> int:
        since = now_us if self._thermal.since_us is None else self._thermal.since_us
        return since + ((now_us - since) // self._every_us + 1) * self._every_us

    def _look(self, now_us: int) -> None:
        """Observe the heat if an observation is due before the sample at ``now_us``."""
        if self._thermal.known or self._last_us is None or self._last_us >= now_us:
            return
        if self._next_look(self._last_us) > now_us or (found := self._monitor.deviations()) is None:
            return
        observed: HeatCorrection | None = None
        if self._monitor.learned - self._learned >= self._needed:
            observed = corrected(self._thermal.covariance, self._slopes(), found)
            self._learned, self._tried = self._monitor.learned, True
        now = observed or HeatCorrection(np.zeros(2), self._thermal.covariance)
        wait_s = self._wait_s(now.covariance, found)
        known = wait_s == 0.0
        self._monitor.judged_us = self._next_look(now_us + round(1e6 * wait_s)) if math.isfinite(wait_s) else None
        if known or observed is not None:
            self._correct(now, known)
            self._since_us = self._thermal.since_us
            self._by_friction = self._thermal.model.mean(self._thermal.parts)
            self._allow()

    def _follow(self) -> None:
        """Follow the ambient heat of an axis that is tested, if that is due."""
        thermal, monitor = self._thermal, self._monitor
        if not thermal.model.ambient or not thermal.known or monitor.open_alarms or self._since_us is None:
            return
        if monitor.learned - self._learned < self._needed or (found := monitor.deviations()) is None:
            return
        # These errors include what the tests allow for now, the uncertain heat, too: it is followed a little later.
        passed_s = (monitor.learned - self._learned) * monitor.settings.interval_s
        row = max(1.0, ERROR_LASTS * thermal.model.tau_s / passed_s)  # number of observations with the same errors
        warmed = (thermal.model.mean(thermal.parts) - self._by_friction) / thermal.model.largest
        covariance = thermal.covariance
        covariance[1, 1] += row * (CURVED * thermal.ambient * warmed) ** 2
        self._learned, self._by_friction = monitor.learned, thermal.model.mean(thermal.parts)
        now = corrected(covariance, self._slopes(), found._replace(errors=found.errors * math.sqrt(row)))
        if now is not None:
            self._correct(now, known=True)
            self._since_us = thermal.since_us

    def _correct(self, now: HeatCorrection, known: bool) -> None:
        """Correct the heat, and the nominal values with it."""
        heat, (low, high) = self._thermal.heat + float(now.step.sum()), self._operating.heat_range
        beyond = max(low - heat, heat - high, 0.0)
        if self._thermal.model.ambient > 0:
            now.covariance[1, 1] = max(float(now.covariance[1, 1]), (EXTRAPOLATED * beyond) ** 2)
        before = self._operating.shift_at_heat(self._thermal.heat)
        self._thermal.observed(now.step, now.covariance, known)
        step = self._operating.shift_at_heat(self._thermal.heat) - before
        self._monitor.move_nominal(np.where(np.isfinite(step), step, 0.0))

    def _wait_s(self, covariance: Floats, found: Deviations) -> float:
        """Time [s] until the heat is known well enough for the tests, if its error only decays.  0: now; inf: never.

        An ambient heat does not decay: if an observation shows none that would explain the deviations, they are tested.

        ``covariance``: of the heats (2, 2) [W^2].
        """
        slopes, tolerated = np.abs(self._slopes()), MAX_SHARE * found.tolerated
        if (slopes * math.sqrt(max(float(covariance.sum()), 0.0)) <= tolerated).all():
            return 0.0
        moved = slopes * math.sqrt(max(float(covariance[0, 0]), 0.0))
        if (moved <= tolerated).all():
            left = self._needed - (self._monitor.learned - self._learned)
            return 0.0 if self._tried else max(left, 1) * self._monitor.settings.interval_s
        with np.errstate(divide="ignore"):
            return float(self._thermal.model.tau_s * np.log(np.max(moved[moved > 0] / tolerated[moved > 0])))

    def _slopes(self) -> Floats:
        """Change of the nominal values (p,) per watt of heat."""
        h, heat = _SLOPE_STEP * self._thermal.model.largest, self._thermal.heat
        step = self._operating.shift_at_heat(heat + h) - self._operating.shift_at_heat(heat - h)
        return np.where(np.isfinite(step), step / (2 * h), 0.0)


def corrected(covariance: Floats, slopes: Floats, found: Deviations) -> HeatCorrection | None:
    """Correction of the heats by the deviations of the estimates, and their covariance (2, 2) [W^2] afterwards.

    None: no heat explains the deviations, not even those of all parameters but a certain one.

    Args:
        covariance: of the heat by friction and the ambient heat before (2, 2) [W^2].
        slopes: change of the nominal values (p,) per watt.
        found: the deviations.
    """
    used, variance = np.flatnonzero((slopes != 0) & np.isfinite(found.d)), float(covariance.sum())
    if not used.size or not variance > 0:
        return None
    measured = _measured(variance, slopes, found, used)
    if measured is None:
        # A fault of one parameter: the heat is what explains all others.
        fewer = [
            _measured(variance, slopes, found, np.delete(used, k)) for k in range(used.size if used.size > 1 else 0)
        ]
        possible = [each for each in fewer if each is not None]
        if len(possible) != 1:
            return None
        measured = possible[0]
    z, r = measured
    gain = covariance.sum(axis=1) / (variance + r)
    return HeatCorrection(gain * z, covariance - np.outer(gain, covariance.sum(axis=1)))


def _measured(variance: float, slopes: Floats, found: Deviations, used: Ints) -> tuple[float, float] | None:
    """Deviation z of the heat [W] by the parameters ``used``, and its variance r; None: no heat explains them.

    ``variance``: of the heat before.
    """
    d, s = found.d[used], slopes[used]
    M = found.covariance[np.ix_(used, used)] + np.diag(found.errors[used] ** 2)
    if d @ np.linalg.solve(M + variance * np.outer(s, s), d) > MAX_SIGMAS**2 * used.size:
        return None
    weighted = np.linalg.solve(M, s)
    r = 1 / float(weighted @ s)
    return r * float(weighted @ d), r


# --- Records: the heat at their first sample is computed back from later samples --------------------------------------


def conditioned_records(
    model: AxisModel, settings: Settings, conditions: Conditions, records: Sequence[SampleBlock]
) -> list[SampleBlock]:
    """Consecutive records of an axis with shift, gate and all signals, as its monitor would get them.

    An unknown heat at the first sample of a record is computed back from the heat observed later, so that no part of
    the record is lost.  If no heat can be observed, the gate of the record is closed throughout.
    """
    operating = Operating(model, conditions)
    return [_conditioned(model, settings, conditions, operating, record) for record in records]


def _conditioned(
    model: AxisModel, settings: Settings, conditions: Conditions, operating: Operating, record: SampleBlock
) -> SampleBlock:
    thermal = operating.thermal
    if thermal is None or record.size < 2:
        return operating.conditioned(record)
    first, first_us = operating.conditioned(record.select(slice(1))), int(record.t_us[0])
    observe = not thermal.known or (thermal.model.ambient > 0 and thermal.since_us == first_us)
    if not observe:
        return concatenate([first, operating.conditioned(record.select(slice(1, None)))])
    start = _first_heat(model, settings, conditions, thermal, record)
    if start is not None:
        thermal.observed(*start, known=True)
    rest = operating.conditioned(record.select(slice(1, None)))
    joined = concatenate([first, rest])
    assert joined.gate is not None
    return joined._replace(gate=joined.gate & (start is not None))


def _first_heat(
    model: AxisModel, settings: Settings, conditions: Conditions, expected: ThermalState, record: SampleBlock
) -> HeatCorrection | None:
    """HeatCorrection of the heat that is expected at the first sample of a record; None: it cannot be observed."""
    observed, plain = Operating(model, conditions), Operating(model, conditions)
    for operating in (observed, plain):
        operating.thermal = copy.copy(expected)
        operating.thermal.known = False
    monitor = AxisMonitor(model, settings)
    warm_up, rest, taken = WarmUp(observed, monitor), record, 0
    thermal, alone = observed.thermal, plain.thermal
    assert thermal is not None
    assert alone is not None
    while not thermal.known:
        part, more = warm_up.part(rest)
        taken += part.size
        if more is None and not thermal.known:
            return None
        monitor.update(part)
        rest = more if more is not None else rest
    plain.take(record.t_us[:taken], record.y[:taken], None)
    if alone.losses > expected.losses:
        return None  # there was a pause of unknown heat in between
    # The observed correction of the heat by friction has decayed since the first sample.
    kept = thermal.model.kept((int(record.t_us[taken - 1]) - int(record.t_us[0])) * 1e-6)
    by_friction = (thermal.model.mean(thermal.parts) - alone.model.mean(alone.parts)) / kept
    step = np.array([by_friction, thermal.ambient - alone.ambient])
    return HeatCorrection(step, thermal.covariance / np.outer([kept, 1.0], [kept, 1.0]))
