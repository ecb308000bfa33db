"""Operating conditions of an axis: nominal values that follow measured signals, and gates.

    theta_0i(s) = v_i + slope_1 (f_1(s) - reference_1) + ...

f is a term: a measured signal, a function of a sum of signals, or a product of these (signal_terms.py).  Where the
slopes are those of Ja and 1/Ja is monitored, or the reverse, theta_0i(s) is the reciprocal of that sum, exactly.  A
gate is open while its signal has the right value; while a gate is closed, nothing is learned and no test runs.

The torque of the weight may instead be an input of the drive (Drive.with_load), w(s) = slope_1 f_1(s) + ..

A signal may also be derived: the heat of an axis without a thermometer (``thermal_state``), which parameters follow as
they follow a measured one.

Every value of a sample depends on the samples up to that one: blocks may be split anywhere.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.measured_speed import MeasuredSpeed
from monitor_core.drive.signal_terms import FUNCTIONS, Term
from monitor_core.drive.structure import split_name
from monitor_core.drive.thermal_state import GAP_S, HEAT, ThermalModel, ThermalState
from monitor_core.samples import SampleBlock
from monitor_core.wording import sentence

MARGIN = 0.1
"""Share of the width of the range in which a slope was found, up to which a nominal value follows beyond its ends."""

_HEAT = Term.read(HEAT)
_SAME = 1e-6
"""Relative difference below which two values of a signal are the same: signals are scaled numbers."""


class Follow(NamedTuple):
    """A parameter follows a term, which may lie between ``low`` and ``high``."""

    name: str
    """The parameter that follows, Ja or 1/Ja, whichever is monitored"""
    term: Term
    slope: float
    reference: float
    low: float = -math.inf
    high: float = math.inf
    margin: float = MARGIN
    """Share of the width of that range, up to which the parameter follows beyond its ends"""

    def change(self, at: Floats) -> Floats:
        """Change of the parameter (N,), at values of the term (N,); NaN where it is unknown."""
        return np.where(self.knows(at), self.slope * (at - self.reference), math.nan)

    def knows(self, at: Floats | float) -> Bools:
        """Whether the parameter follows (N,), at values of the term (N,)."""
        reach = self.margin * (self.high - self.low) if math.isfinite(self.high - self.low) else 0.0
        return np.asarray((at >= self.low - reach) & (at <= self.high + reach), np.bool_)


class Gate(NamedTuple):
    """Open while the signal is one of ``equals``, if there are any, and between ``above`` and ``below``."""

    signal: str
    equals: tuple[float, ...] = ()
    above: float = -math.inf
    below: float = math.inf

    def open(self, values: Floats) -> Bools:
        """Whether the gate is open (N,), at values of the signal (N,); it is closed at NaN."""
        between = (values > self.above) & (values < self.below)
        if not self.equals:
            return np.asarray(between, np.bool_)
        near = [np.abs(values - value) <= _SAME * max(1.0, abs(value)) for value in self.equals]
        return np.asarray(between & np.any(near, axis=0), np.bool_)


@dataclass(frozen=True)
class Conditions:
    """Operating conditions of an axis.  ``signals`` names the columns of the measured signals.

    ``min_speed``: nothing is learned while the axis turns more slowly (rad/s, at the sensor); 0: no limit.
    ``thermal``: how the axis warms up; its heat is one more signal, the last one.  None: there is none.
    ``weight``: terms of the nominal weight of a drive that has it as an input; their names and references do not count.
    """

    signals: tuple[str, ...] = ()
    follows: tuple[Follow, ...] = ()
    gates: tuple[Gate, ...] = ()
    min_speed: float = 0.0
    thermal: ThermalModel | None = None
    weight: tuple[Follow, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All signals, the measured ones first."""
        return self.signals if self.thermal is None else (*self.signals, HEAT)

    def __bool__(self) -> bool:
        return bool(self.follows or self.gates or self.min_speed > 0 or self.weight)


class _Taken(NamedTuple):
    shift: Floats  # (N, p)
    gate: Bools  # (N,)
    weight: Floats | None  # (N,); None: the drive does not have it as an input
    signals: Floats  # (N, S)


class Operating:
    """The operating conditions of one axis, from sample to sample.

    Raises:
        KeyError: a term or a gate is of a signal that is not there.
        ValueError: a parameter is to follow a signal but is not monitored, or has slopes of both Ja and 1/Ja; a
            function does not exist.
    """

    def __init__(self, model: AxisModel, conditions: Conditions) -> None:
        self._model, self._conditions = model, conditions
        self._column = {name: k for k, name in enumerate(conditions.columns)}
        self._followers = [
            _follower(model, i, conditions.follows) for i in _followed(model, conditions.follows)
        ]
        self._weight = tuple(follow._replace(reference=0.0) for follow in conditions.weight)
        every = (*conditions.follows, *conditions.weight)
        wanted = {name for f in every for name in f.term.signals} | {g.signal for g in conditions.gates}
        if missing := wanted - self._column.keys():
            raise KeyError(f"no signal {', '.join(sorted(missing))}")
        self._speed = MeasuredSpeed(model.drive.output)
        self.thermal = None if conditions.thermal is None else ThermalState(conditions.thermal)
        """The heat of the axis; None: it has no thermal model"""
        self._last: tuple[Floats, float] | None = None

    def take(self, t_us: NDArray[np.int64], y: Floats, signals: Floats | None) -> tuple[Floats, Bools]:
        """Shift theta_0(s) - theta_0 (N, p), NaN where it is unknown, and whether to learn (N,).

        Args:
            t_us: times of the samples (N,) [us].
            y: measured output (N,), rad or rad/s.
            signals: the signals at the samples (N, S); NaN, or None for all of them: unknown.
        """
        found = self._take(t_us, y, signals)
        return found.shift, found.gate

    def conditioned(self, block: SampleBlock) -> SampleBlock:
        """The samples with shift, gate, weight, and all signals, the derived ones too."""
        found = self._take(block.t_us, block.y, block.signals)
        conditioned = block._replace(shift=found.shift, gate=found.gate, weight=found.weight)
        return conditioned if self.thermal is None else conditioned._replace(signals=found.signals)

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
        for follower in self._followers:
            shift[:, follower.i] = follower.shift(s, self._column)
        gate = np.ones(N, np.bool_)
        for entry in c.gates:
            gate &= entry.open(s[:, self._column[entry.signal]])
        if c.min_speed > 0:
            gate &= speed >= c.min_speed
        weight = None
        if self._weight:
            weight = sum((f.change(_term(f.term, s, self._column)) for f in self._weight), np.zeros(N))
            gate &= np.isfinite(weight)
        if N:
            self._last = s[-1].copy(), float(speed[-1])
        return _Taken(shift, gate, weight, s)

    def following(self, signal: str) -> tuple[str, ...]:
        """Monitored parameters that follow this signal, or a function of it."""
        return tuple(f.name for f in self._followers if any(signal in x.term.signals for x in f.follows))

    def alike(self, t_us: NDArray[np.int64]) -> int:
        """Number of the first samples (of N) between which no pause makes the heat unknown, or could."""
        if self.thermal is None:
            return len(t_us)
        pauses = np.flatnonzero(np.abs(np.diff(t_us)) > GAP_S * 1e6)
        return int(pauses[0]) + 1 if pauses.size else len(t_us)

    def shift_at_heat(self, heat: float) -> Floats:
        """Shift (p,) at the last signals, were the heat another one [W]; NaN where it is unknown."""
        shift = np.zeros(len(self._model.monitored))
        if self._last is None or self.thermal is None:
            return shift
        s = self._last[0].copy()
        s[self._column[HEAT]] = heat
        for follower in self._followers:
            shift[follower.i] = follower.shift(s[np.newaxis], self._column)[0]
        return shift

    @property
    def heat_range(self) -> tuple[float, float]:
        """Lowest and highest heat at which friction is known from records."""
        known = [(f.low, f.high) for follower in self._followers for f in follower.follows if f.term == _HEAT]
        return max((low for low, _ in known), default=-math.inf), min(
            (high for _, high in known), default=math.inf
        )

    def shift_beyond(self) -> Floats:
        """Part (p,) of the shift at the last sample that the heat makes beyond the range that is known."""
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
        """A sentence if the heat at the last sample is beyond that range and its margin; otherwise empty."""
        if self.thermal is None or self._last is None:
            return ""
        low, high = self.heat_range
        if Follow("", _HEAT, 0.0, 0.0, low, high).knows(self.thermal.heat):
            return ""
        return sentence(
            "heat",
            "heat = {heat}, friction known from {low} to {high}",
            heat=f"{self.thermal.heat:.3g}",
            low=f"{low:.3g}",
            high=f"{high:.3g}",
        )

    def to_arrays(self) -> dict[str, NDArray[np.generic]] | None:
        """What must be saved to carry on after a restart: arrays by name; None: nothing."""
        if self.thermal is None or self._speed.before is None:
            return None
        return {"heat": self.thermal.to_array(), "before": np.array(self._speed.before, np.float64)}

    def from_arrays(self, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from a saved state.

        Raises:
            KeyError: an array is missing.
            ValueError: an array is no such state.
        """
        heat, before = (np.asarray(arrays[name], np.float64) for name in ("heat", "before"))
        if self.thermal is None or before.shape != (2,) or not np.isfinite(before).all():
            raise ValueError("this is no state of a warm-up")
        self.thermal.restore(heat)
        self._speed.before = int(before[0]), float(before[1])

    @property
    def reason(self) -> str:
        """Why the conditions prevented learning from the last sample; empty: they did not."""
        return next(self._reasons(), "")

    def _reasons(self) -> Iterator[str]:
        if self._last is None:
            return
        (s, speed), c = self._last, self._conditions
        for gate in c.gates:
            value = s[self._column[gate.signal]]
            if not gate.open(np.array([value])).all():
                yield _at(gate.signal, value)
        if c.min_speed > 0 and not speed >= c.min_speed:
            yield sentence("slow", "slower than {speed} rad/s", speed=f"{c.min_speed:g}")
        for follower in self._followers:
            yield from follower.reasons(s[np.newaxis], self._column)
        yield from _unknown(self._weight, s[np.newaxis], self._column)


class _Follower(NamedTuple):
    """theta_i with all terms that it follows."""

    i: int
    name: str
    follows: tuple[Follow, ...]
    value: float  # of the parameter that the slopes are of
    theta0: float  # of the monitored one
    reciprocal: bool  # one is the reciprocal of the other
    limits: tuple[float, float]  # of theta

    def shift(self, s: Floats, column: Mapping[str, int]) -> Floats:
        """theta_0i(s) - theta_0i (N,) at signals (N, S)."""
        change = np.zeros(len(s))
        for follow in self.follows:
            change = change + follow.change(_term(follow.term, s, column))
        if self.reciprocal:
            with np.errstate(divide="ignore"):
                change = 1 / (self.value + change) - self.theta0
        theta = self.theta0 + change
        possible = (theta > self.limits[0]) & (theta < self.limits[1])
        return np.where(possible, change, math.nan)

    def reasons(self, s: Floats, column: Mapping[str, int]) -> Iterator[str]:
        """Why the shift at signals (1, S) is unknown."""
        if unknown := [*_unknown(self.follows, s, column)]:
            yield unknown[0]
            return
        if math.isnan(self.shift(s, column)[0]):
            yield sentence("bounds", "{name} would leave its bounds", name=self.name)


def _term(term: Term, s: Floats, column: Mapping[str, int]) -> Floats:
    """The term (N,) at signals (N, S)."""
    return term.value({name: s[:, column[name]] for name in term.signals})


def _unknown(follows: Iterable[Follow], s: Floats, column: Mapping[str, int]) -> Iterator[str]:
    """The terms whose change at signals (1, S) is unknown, with the reason."""
    for follow in follows:
        at = _term(follow.term, s, column)
        if math.isnan(follow.change(at)[0]):
            found = _at(str(follow.term), at[0])
            low, high = f"{follow.low:g}", f"{follow.high:g}"
            yield (
                found
                if math.isnan(at[0])
                else sentence("beyond", "{found}, beyond {low} to {high}", found=found, low=low, high=high)
            )


def _at(name: str, value: float) -> str:
    if math.isnan(value):
        return sentence("not known", "{name} is not known", name=name)
    return sentence("value", "{name} = {value}", name=name, value=f"{value:g}")


def _followed(model: AxisModel, follows: tuple[Follow, ...]) -> list[int]:
    """Which of theta follow a term."""
    bases = [split_name(name)[0] for name in model.monitored]
    for entry in follows:
        if split_name(entry.name)[0] not in bases:
            raise ValueError(f"{entry.name} is to follow {entry.term}, but is not monitored")
        if unknown := [name for name in entry.term.functions if name not in FUNCTIONS]:
            raise ValueError(f"no function {unknown[0]} of signals; there is {', '.join(FUNCTIONS)}")
    return sorted({bases.index(split_name(follow.name)[0]) for follow in follows})


def _follower(model: AxisModel, i: int, follows: tuple[Follow, ...]) -> _Follower:
    base, inverse = split_name(model.monitored[i])
    mine = tuple(follow for follow in follows if split_name(follow.name)[0] == base)
    if len({entry.name for entry in mine}) > 1:
        raise ValueError(f"slopes of both {base} and 1/{base}: give those of one of them")
    of_inverse = split_name(mine[0].name)[1]
    value = model.nominal[base]
    return _Follower(
        i,
        model.monitored[i],
        mine,
        1 / value if of_inverse else value,
        1 / value if inverse else value,
        of_inverse != inverse,
        (float(model.limits[0, i]), float(model.limits[1, i])),
    )
