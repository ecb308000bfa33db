"""The heat of an axis as its estimates show it, where nothing else determines it (``drive.thermal_state``).

After a start or a pause of which nothing is known, the heat is uncertain by its whole range.  The parameters that
follow it are then estimated, but not tested.  From their deviation d, the covariance C of the estimates and the slopes
s of the nominal values over the heat, the heat is corrected as by a Kalman filter,

    heat <- heat + V s' M^-1 d,   V <- 1 / (1 / V + s' M^-1 s),   M = C + diag(error^2),

with the standard deviations of what healthy estimates are off by beside their scatter, until what is left of its
uncertainty moves no nominal value by more than a part of what the tests tolerate.  Only the parameters that follow the
heat are used: a change of another one does not affect it.  A change of friction that is there already cannot be
distinguished from heat, unless it is larger than heat could be.

What the thermal model lacks is part of what the tests tolerate (``Settings.model_error``).  They tolerate, too, by how
much the nominal values are off if the heat is off by its standard deviation, as after a pause; and beyond the heat of
the records all that the straight lines change there.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.operating_conditions import Conditions, Operating
from monitor_core.drive.thermal_state import GAP_S, HEAT, ThermalState
from monitor_core.monitoring.axis_monitor import AxisMonitor
from monitor_core.monitoring.lane_status import Deviations
from monitor_core.samples import SampleBlock, concatenate
from monitor_core.settings import Settings

LOOKS_PER_MEMORY = 2
"""Number of checks per memory whether the heat can be observed."""
MEMORIES = 4
"""Memories of motion until the estimates belong to the present heat."""
SHARE = 0.5
"""Share of what the tests tolerate by which the uncertainty of the heat may move a nominal value."""
FARTHEST = 3.0
"""In standard deviations: friction that is farther from what any heat explains has changed, and is no sign of heat."""
LOOKS_ALIKE = "a warmer or colder gearbox"
"""Than its motion makes it: what a change of a parameter that follows the heat may also be, for alarms."""
_STEP = 1e-3
"""Step for slopes, as a share of the largest heat."""


class WarmUp:
    """Lets an axis take its samples part by part, so that its heat is observed at times that depend on them alone.

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
        monitor.look_alike = dict.fromkeys(operating.following(HEAT), LOOKS_ALIKE)
        s = monitor.settings
        self._every_us = max(1, round(1e6 * s.memory * s.interval_s / LOOKS_PER_MEMORY))
        self._needed, self._widen_us = (
            round(MEMORIES * s.memory),
            self._every_us * LOOKS_PER_MEMORY * MEMORIES,
        )
        self._since_us: int | None = None  # when the heat that is being observed became unknown
        self._learned = 0  # samples, at that time or at the last observation
        self._last_us: int | None = None
        self.widened = ""
        """A sentence if the heat is far beyond that of the records, where friction is tested with a wider allowance"""

    def part(self, block: SampleBlock) -> tuple[SampleBlock, SampleBlock | None]:
        """The first samples of a block, with their conditions, for the monitor; and the others, if any.

        The monitor must take the part before the next one is asked for.
        """
        if not block.size:
            return self._operating.conditioned(block), None
        now_us = int(block.t_us[0])
        self._look(now_us)
        if self._last_us is None or self._last_us // self._widen_us != now_us // self._widen_us:
            self._allow()
        n = self._alike(block)
        taken = self._operating.conditioned(block.select(slice(n)))
        self._last_us = int(block.t_us[n - 1])
        if self._thermal.since_us != self._since_us:
            self._since_us, self._learned = self._thermal.since_us, self._monitor.learned
            self._monitor.judged_us = None
            self._allow(doubt=False)
            if self._thermal.known and (found := self._monitor.deviations()) is not None:
                self._thermal.known = self._wait_s(self._thermal.sd_of_start, found) == 0.0
            self._allow()
        self._monitor.judge(self._thermal.known)
        return taken, block.select(slice(n, None)) if n < block.size else None

    def _alike(self, block: SampleBlock) -> int:
        """Number of samples before the next look, and before a pause."""
        if self._last_us is None or abs(int(block.t_us[0]) - self._last_us) > GAP_S * 1e6:
            return 1
        n, now_us = self._operating.alike(block.t_us), int(block.t_us[0])
        due_us = (now_us // self._widen_us + 1) * self._widen_us
        if not self._thermal.known:
            due_us = min(due_us, self._next_look(now_us))
        due = np.flatnonzero(block.t_us[:n] >= due_us)
        return int(due[0]) if due.size else n

    def _allow(self, doubt: bool = True) -> None:
        """Set what the tests tolerate now: beyond the heat of the records, and as the heat is not certain."""
        self.widened, more = self._operating.far_beyond, np.abs(self._operating.shift_beyond())
        if doubt and self._thermal.known:
            more = more + np.abs(self._slopes()) * self._thermal.sd_of_start
        self._monitor.allow(more, bool(self.widened))

    def _next_look(self, now_us: int) -> int:
        since = now_us if self._thermal.since_us is None else self._thermal.since_us
        return since + ((now_us - since) // self._every_us + 1) * self._every_us

    def _look(self, now_us: int) -> None:
        """Observe the heat when it is time to, before the sample at ``now_us``."""
        if self._thermal.known or self._last_us is None or self._last_us >= now_us:
            return
        if self._next_look(self._last_us) > now_us or (found := self._monitor.deviations()) is None:
            return
        # What the model lacks is in what the tests tolerate: no observation makes it less.
        heat, sd = self._thermal.heat, self._thermal.sd_of_start
        if self._monitor.learned - self._learned >= self._needed:
            heat, sd = corrected(heat, sd, self._slopes(), found)
            self._learned = self._monitor.learned
        wait_s = self._wait_s(sd, found)
        known = wait_s == 0.0
        self._monitor.judged_us = (
            self._next_look(now_us + round(1e6 * wait_s)) if math.isfinite(wait_s) else None
        )
        if known or heat != self._thermal.heat:
            before = self._operating.shift_at_heat(self._thermal.heat)
            self._thermal.observed(heat, sd, known)
            step = self._operating.shift_at_heat(self._thermal.heat) - before
            self._monitor.move_nominal(np.where(np.isfinite(step), step, 0.0))
            self._since_us = self._thermal.since_us
            self._allow()

    def _wait_s(self, sd: float, found: Deviations) -> float:
        """Time until a heat with this standard deviation [W] is known well enough for the tests, if nothing shows it.

        0: it is; inf: it never will be.
        """
        moved, tolerated = np.abs(self._slopes()) * sd, SHARE * found.tolerated
        if (moved <= tolerated).all():
            return 0.0
        with np.errstate(divide="ignore"):
            return float(self._thermal.model.tau_s * np.log(np.max(moved[moved > 0] / tolerated[moved > 0])))

    def _slopes(self) -> Floats:
        """Change of the nominal values (p,) for each watt."""
        h, heat = _STEP * self._thermal.model.largest, self._thermal.heat
        step = self._operating.shift_at_heat(heat + h) - self._operating.shift_at_heat(heat - h)
        return np.where(np.isfinite(step), step / (2 * h), 0.0)


def corrected(heat: float, sd: float, slopes: Floats, found: Deviations) -> tuple[float, float]:
    """Heat and its standard deviation [W] after what the estimates show; slopes (p,) of the nominal values."""
    which = np.flatnonzero((slopes != 0) & np.isfinite(found.d))
    if not which.size or not sd > 0:
        return heat, sd
    d, s = found.d[which], slopes[which]
    M = found.covariance[np.ix_(which, which)] + np.diag(found.errors[which] ** 2)
    if d @ np.linalg.solve(M + sd**2 * np.outer(s, s), d) > FARTHEST**2 * which.size:
        return heat, sd
    weighted = np.linalg.solve(M, s)
    variance = 1 / (1 / sd**2 + float(weighted @ s))
    return heat + variance * float(weighted @ d), float(np.sqrt(variance))


# --- Records, whose first heat is found afterwards --------------------------------------------------------------------


def conditioned_records(
    model: AxisModel, settings: Settings, conditions: Conditions, records: Sequence[SampleBlock]
) -> list[SampleBlock]:
    """Records of an axis in a row with shift, gate and all signals, as its monitor would get them.

    Where the heat at the first sample of a record is not known it is computed back from what is observed later, so that
    no part of the record is lost; where nothing is observed, the gate is closed throughout.
    """
    operating, found = Operating(model, conditions), list[SampleBlock]()
    for record in records:
        if operating.thermal is None or record.size < 2:
            found.append(operating.conditioned(record))
        else:
            found.append(_conditioned(model, settings, conditions, operating, record))
    return found


def _conditioned(
    model: AxisModel, settings: Settings, conditions: Conditions, operating: Operating, record: SampleBlock
) -> SampleBlock:
    thermal = operating.thermal
    assert thermal is not None
    first = operating.conditioned(record.select(slice(1)))
    if thermal.known:
        return concatenate([first, operating.conditioned(record.select(slice(1, None)))])
    start = _first_heat(model, settings, conditions, record)
    if start is not None:
        thermal.observed(*start, known=True)
    rest = operating.conditioned(record.select(slice(1, None)))
    joined = concatenate([first, rest])
    assert joined.gate is not None
    return joined._replace(gate=joined.gate & (start is not None))


def _first_heat(
    model: AxisModel, settings: Settings, conditions: Conditions, record: SampleBlock
) -> tuple[float, float] | None:
    """Heat at the first sample of a record and its standard deviation [W]; None: it cannot be observed."""
    assert conditions.thermal is not None
    unknown = replace(conditions, thermal=replace(conditions.thermal, start="unknown"))
    observed, plain = Operating(model, unknown), Operating(model, unknown)
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
    if alone.losses > 1:
        return None  # a pause in between, of which nothing is known
    # What was observed is a difference to the heat without, which has decayed since the first sample.
    kept = thermal.model.kept((int(record.t_us[taken - 1]) - int(record.t_us[0])) * 1e-6)
    return thermal.model.largest / 2 + (thermal.heat - alone.heat) / kept, thermal.sd_of_start / kept
