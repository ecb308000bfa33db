"""Operating conditions of an axis: nominal values that follow measured signals, and gates.

    theta_0i(s) = v_i + slope_1 (f_1(s) - reference_1) + ...

f is a term: a measured signal, a function of a sum of signals, or a product of these (signal_terms.py).  If the slopes
are given for Ja and 1/Ja is monitored, or the reverse, theta_0i(s) is exactly the reciprocal of that sum.  While a
gate is closed (gates.py), or a brake holds the axis (holding_brake.py), no estimate is updated and no test runs.

The torque of the weight may instead be an input of the drive (Drive.with_load), w(s) = slope_1 f_1(s) + ..

A signal may also be derived: the heat of an axis without a thermometer (``thermal_state``) is used like a measured
signal.

All results for a sample depend only on samples up to that one: blocks may be split anywhere.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.gates import Gate, OpenGates, value_words
from monitor_core.drive.holding_brake import HoldingBrake
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.parameter_names import split_name
from monitor_core.drive.signal_terms import FUNCTIONS, Factor, Term
from monitor_core.drive.thermal_state import GAP_S, HEAT, ThermalModel, ThermalState
from monitor_core.samples import SampleBlock
from monitor_core.wording import sentence

MARGIN = 0.1
"""A nominal value follows a signal beyond the ends of the range of its slope, by up to this share of the width."""

_HEAT = Term.read(HEAT)


class NominalSchedule(NamedTuple):
    """A nominal value that follows a term of signals:  theta_0(s) = theta_0 + slope (term(s) - reference).

    The slope is valid between ``low`` and ``high`` of the term.
    """

    name: str
    """The parameter that the slope belongs to: Ja or 1/Ja, no matter which is monitored"""
    term: Term
    """A signal, or a function of signals: ``Term.read("temperature")``, ``Term.read("payload * cos(angle2)")``"""
    slope: float
    """In the unit of the parameter per unit of the term"""
    reference: float
    """The term at which the nominal value holds, in the unit of the term, as are ``low`` and ``high``"""
    low: float = -math.inf
    high: float = math.inf
    margin: float = MARGIN
    """The slope is also used beyond the ends, by up to this share of the width"""

    def change(self, values: Floats) -> Floats:
        """Change of the parameter (N,) for values of the term (N,); NaN where it is unknown."""
        return np.where(self.knows(values), self.slope * (values - self.reference), math.nan)

    def knows(self, values: Floats | float) -> Bools:
        """Whether the slope is valid (N,) for values of the term (N,)."""
        reach = self.margin * (self.high - self.low) if math.isfinite(self.high - self.low) else 0.0
        return np.asarray((values >= self.low - reach) & (values <= self.high + reach), np.bool_)


@dataclass(frozen=True)
class Conditions:
    """Operating conditions of an axis.  ``signals``: names of the columns of the measured signals.

    ``min_speed``: the gate is closed while the axis turns more slowly (rad/s, at the sensor); 0: no limit.
    ``thermal``: thermal model of the warm-up, which adds its heat as the last signal; None: no model.
    ``weight``: terms of the nominal weight, for a drive that has it as an input; their names and references are
    ignored.
    ``angles``: names of angles of the arm that nominal values may follow, as far as the records tell.
    """

    signals: tuple[str, ...] = ()
    schedules: tuple[NominalSchedule, ...] = ()
    gates: tuple[Gate, ...] = ()
    min_speed: float = 0.0
    thermal: ThermalModel | None = None
    weight: tuple[NominalSchedule, ...] = ()
    angles: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All signals, the measured ones first."""
        return self.signals if self.thermal is None else (*self.signals, HEAT)

    @property
    def pose_angles(self) -> tuple[str, ...]:
        """Names of the angles that nominal values follow, by cosines and sines, and of those that they may follow."""
        factors = [factor for f in (*self.schedules, *self.weight) for factor in f.term.factors]
        turning = [factor for factor in factors if factor.function in ("cos", "sin")]
        followed = [name for factor in turning for _, name in factor.addends]
        return tuple(dict.fromkeys([*followed, *self.angles]))

    def __bool__(self) -> bool:
        return bool(self.schedules or self.gates or self.min_speed > 0 or self.weight or self.angles)


class _Taken(NamedTuple):
    shift: Floats  # (N, p)
    gate: Bools  # (N,)
    weight: Floats | None  # (N,); None: the drive does not have it as an input
    signals: Floats  # (N, S)


class Operating:
    """The operating conditions of one axis, from sample to sample: ``conditioned`` prepares blocks for ``update``.

    Raises:
        KeyError: a term or a gate needs a signal that does not exist.
        ValueError: a parameter that follows a signal is not monitored, or has slopes for both Ja and 1/Ja; or a
            function does not exist.
    """

    def __init__(self, model: AxisModel, conditions: Conditions) -> None:
        self._model, self._conditions = model, conditions
        self._column = {name: k for k, name in enumerate(conditions.columns)}
        schedules = conditions.schedules
        self._scheduled = [_scheduled_parameter(model, i, schedules) for i in _indices(model, schedules)]
        self._weight = tuple(schedule._replace(reference=0.0) for schedule in conditions.weight)
        every = (*conditions.schedules, *conditions.weight)
        wanted = {name for f in every for name in f.term.signals} | {g.signal for g in conditions.gates}
        if missing := wanted - self._column.keys():
            raise KeyError(f"no signal {', '.join(sorted(missing))}")
        self._gates = OpenGates(conditions.gates)
        self._speed = MeasuredSpeed(model.drive.output)
        brake = HoldingBrake(model)
        self._brake = brake if brake.possible else None
        self.thermal = None if conditions.thermal is None else ThermalState(conditions.thermal)
        """The heat of the axis; None: there is no thermal model"""
        self._last: tuple[Floats, float] | None = None

    @property
    def needed(self) -> bool:
        """Whether these conditions, or a brake, may change anything for a sample."""
        return bool(self._conditions) or self._brake is not None

    def take(self, t_us: NDArray[np.int64], y: Floats, signals: Floats | None) -> tuple[Floats, Bools]:
        """Shift theta_0(s) - theta_0 (N, p), NaN where it is unknown, and whether all gates are open (N,).

        Args:
            t_us: times of the samples (N,) [us].
            y: measured output (N,), rad or rad/s.
            signals: the measured signals (N, S); NaN: unknown; None: all are unknown.
        """
        taken = self._take(t_us, y, signals)
        return taken.shift, taken.gate

    def conditioned(self, block: SampleBlock) -> SampleBlock:
        """The samples with shift, gate, weight, and all signals including the derived ones."""
        taken = self._take(block.t_us, block.y, block.signals)
        if self._brake is not None:
            taken.gate[self._brake.take(block.t_us, block.u, block.y, taken.weight)] = False
        conditioned = block._replace(shift=taken.shift, gate=taken.gate, weight=taken.weight)
        return conditioned if self.thermal is None else conditioned._replace(signals=taken.signals)

    def _take(self, t_us: NDArray[np.int64], y: Floats, signals: Floats | None) -> _Taken:
        N, c = len(t_us), self._conditions
        s = np.full((N, len(c.signals)), math.nan) if signals is None else signals
        speed = np.zeros(N)
        if c.min_speed > 0 or self.thermal is not None:
            steps = self._speed.take(t_us, y)
            speed = steps.speed
            if self.thermal is not None:
                s = np.column_stack([s, self.thermal.take(t_us, steps)])
        shift = np.zeros((N, len(self._model.monitored)))
        by_name = self._by_name(s)
        for parameter in self._scheduled:
            shift[:, parameter.i] = parameter.shift(by_name)
        gate = self._gates.take(t_us, by_name)
        if c.min_speed > 0:
            gate &= speed >= c.min_speed
        weight = None
        if self._weight:
            factors = dict[Factor, Floats]()  # many terms have the same
            weight = sum((f.change(f.term.value(by_name, factors)) for f in self._weight), np.zeros(N))
            gate &= np.isfinite(weight)
        if N:
            self._last = s[-1].copy(), float(speed[-1])
        return _Taken(shift, gate, weight, s)

    def _by_name(self, s: Floats) -> dict[str, Floats]:
        """The columns (N,) of signals (N, S)."""
        return {name: s[:, k] for name, k in self._column.items()}

    def following(self, signal: str) -> tuple[str, ...]:
        """Names of the monitored parameters that follow this signal, or a function of it."""
        return tuple(f.name for f in self._scheduled if any(signal in s.term.signals for s in f.schedules))

    def samples_before_pause(self, t_us: NDArray[np.int64]) -> int:
        """Number of samples before the first pause, after which the heat may be unknown; all N if there is none."""
        if self.thermal is None:
            return len(t_us)
        pauses = np.flatnonzero(np.abs(np.diff(t_us)) > GAP_S * 1e6)
        return int(pauses[0]) + 1 if pauses.size else len(t_us)

    def shift_at_heat(self, heat: float) -> Floats:
        """Shift (p,) for the last signals with another heat [W]; NaN where it is unknown."""
        shift = np.zeros(len(self._model.monitored))
        if self._last is None or self.thermal is None:
            return shift
        s = self._last[0].copy()
        s[self._column[HEAT]] = heat
        by_name = self._by_name(s[np.newaxis])
        for parameter in self._scheduled:
            shift[parameter.i] = parameter.shift(by_name)[0]
        return shift

    @property
    def heat_range(self) -> tuple[float, float]:
        """Lowest and highest heat [W] at which friction is known from records."""
        known = [(f.low, f.high) for parameter in self._scheduled for f in parameter.schedules if f.term == _HEAT]
        return max((low for low, _ in known), default=-math.inf), min((high for _, high in known), default=math.inf)

    def shift_beyond(self) -> Floats:
        """Part (p,) of the shift at the last sample that is extrapolated beyond ``heat_range``."""
        if self.thermal is None:
            return np.zeros(len(self._model.monitored))
        low, high = self.heat_range
        nearest = min(max(self.thermal.heat, low), high)
        if nearest == self.thermal.heat:
            return np.zeros(len(self._model.monitored))
        beyond = self.shift_at_heat(self.thermal.heat) - self.shift_at_heat(nearest)
        return np.where(np.isfinite(beyond), beyond, 0.0)

    @property
    def far_beyond(self) -> str:
        """A sentence if the heat at the last sample is beyond ``heat_range`` and its margin; otherwise empty."""
        if self.thermal is None or self._last is None:
            return ""
        low, high = self.heat_range
        if NominalSchedule("", _HEAT, 0.0, 0.0, low, high).knows(self.thermal.heat):
            return ""
        return sentence(
            "heat",
            "heat = {heat}, friction known from {low} to {high}",
            heat=f"{self.thermal.heat:.3g}",
            low=f"{low:.3g}",
            high=f"{high:.3g}",
        )

    def to_arrays(self) -> dict[str, NDArray[np.generic]] | None:
        """The state to save, as arrays by name; None: there is nothing to save."""
        if self.thermal is None or self._speed.before is None:
            return None
        return {"heat": self.thermal.to_array(), "before": np.array(self._speed.before, np.float64)}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: an array does not have the form of such a state.
        """
        heat, before = (np.asarray(arrays[name], np.float64) for name in ("heat", "before"))
        if self.thermal is None or before.shape != (2,) or not np.isfinite(before).all():
            raise ValueError("this is no state of a warm-up")
        self.thermal.restore(heat)
        self._speed.before = int(before[0]), float(before[1])

    @property
    def reason(self) -> str:
        """Why the conditions excluded the last sample, as a sentence; empty if they did not."""
        return next(self._reasons(), "")

    def _reasons(self) -> Iterator[str]:
        if self._last is None:
            return
        (s, speed), c = self._last, self._conditions
        by_name = self._by_name(s[np.newaxis])
        yield from self._gates.closed({name: float(values[0]) for name, values in by_name.items()})
        for parameter in self._scheduled:
            yield from parameter.reasons(by_name)
        yield from _unknown(self._weight, by_name)
        if self._brake is not None and self._brake.holds:
            yield sentence("brake", "held by its brake: it stands, and the motor does not bear its weight")
        if c.min_speed > 0 and not speed >= c.min_speed:  # the last one, as it seldom lasts
            yield sentence("slow", "slower than {speed} rad/s", speed=f"{c.min_speed:g}")


class _ScheduledParameter(NamedTuple):
    """theta_i with all terms that it follows."""

    i: int
    name: str
    schedules: tuple[NominalSchedule, ...]
    value: float  # nominal value of the parameter that the slopes belong to
    theta0: float  # nominal value of the monitored parameter
    reciprocal: bool  # whether one of these two is the reciprocal of the other
    limits: tuple[float, float]  # bounds of theta_i

    def shift(self, signals: Mapping[str, Floats]) -> Floats:
        """theta_0i(s) - theta_0i (N,) for signals (N,) by name; NaN where it is unknown."""
        change = sum((schedule.change(schedule.term.value(signals)) for schedule in self.schedules), np.zeros(()))
        if self.reciprocal:
            with np.errstate(divide="ignore"):
                change = 1 / (self.value + change) - self.theta0
        theta = self.theta0 + change
        possible = (theta > self.limits[0]) & (theta < self.limits[1])
        return np.where(possible, change, math.nan)

    def reasons(self, signals: Mapping[str, Floats]) -> Iterator[str]:
        """Sentences that say why the shift for signals (1,) by name is unknown."""
        if unknown := [*_unknown(self.schedules, signals)]:
            yield unknown[0]
            return
        if math.isnan(self.shift(signals)[0]):
            yield sentence("bounds", "{name} would leave its bounds", name=self.name)


def _unknown(schedules: Iterable[NominalSchedule], signals: Mapping[str, Floats]) -> Iterator[str]:
    """Sentences on the terms whose change for signals (1,) by name is unknown."""
    for schedule in schedules:
        (value,) = schedule.term.value(signals)
        if not schedule.knows(value):
            shown = value_words(str(schedule.term), value)
            low, high = f"{schedule.low:g}", f"{schedule.high:g}"
            beyond = sentence("beyond", "{found}, beyond {low} to {high}", found=shown, low=low, high=high)
            yield shown if math.isnan(value) else beyond


def _indices(model: AxisModel, schedules: tuple[NominalSchedule, ...]) -> list[int]:
    """Indices of the parameters in theta that follow a term."""
    bases = [split_name(name)[0] for name in model.monitored]
    for schedule in schedules:
        if split_name(schedule.name)[0] not in bases:
            raise ValueError(f"{schedule.name} is to follow {schedule.term}, but is not monitored")
        if unknown := [name for name in schedule.term.functions if name not in FUNCTIONS]:
            raise ValueError(f"no function {unknown[0]} of signals; there is {', '.join(FUNCTIONS)}")
    return sorted({bases.index(split_name(schedule.name)[0]) for schedule in schedules})


def _scheduled_parameter(model: AxisModel, i: int, schedules: tuple[NominalSchedule, ...]) -> _ScheduledParameter:
    base, inverse = split_name(model.monitored[i])
    mine = tuple(schedule for schedule in schedules if split_name(schedule.name)[0] == base)
    if len({schedule.name for schedule in mine}) > 1:
        raise ValueError(f"slopes of both {base} and 1/{base}: give those of one of them")
    of_inverse = split_name(mine[0].name)[1]
    value = model.nominal[base]
    return _ScheduledParameter(
        i,
        model.monitored[i],
        mine,
        1 / value if of_inverse else value,
        1 / value if inverse else value,
        of_inverse != inverse,
        (float(model.limits[0, i]), float(model.limits[1, i])),
    )
