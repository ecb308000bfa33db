"""Finds the coupling of a motor to the motion of other axes, from its friction.

In many wrists a motor also moves when an axis before it turns: its speed is w + sum_j c_j w_j, with w that of its own
axis.  Friction follows the motor, so it reverses where the motor does:

    J w' + fc sign(w + sum_j c_j w_j) + sum_j (f_j w_j + m_j w_j' + d_j sign(w_j)) + f w + tau0 + (links) = u

The reversal alone is the evidence.  The acceleration of another axis takes a torque in any arm, so the terms of w_j
have values of their own, with the factors c_j or without.  Where the axis stands, friction holds any torque, which may
seem to follow another axis in a program that repeats itself.  So the factors must also explain much more where the axis
moves, and where it moves one way and its motor the other way: there, no other friction has that sign.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from monitor_core.arrays import Bools, Floats
from monitor_core.drive.signal_terms import Term
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import WINDOWS, GridPart, of_unit_length, speed_of
from monitor_core.identification.weight.weight_balance import WeightBalance, moving_parts

_STEEPER = 0.25
"""A speed scale of Coulomb friction below the usual ones: else a larger factor makes friction reverse more steeply."""
_TRIALS = np.geomspace(0.02, 3.0, 16)
"""Speeds that a coupling adds to the motor, over the usual speed of the axis, that are tried with either sign"""
_NEAR = np.geomspace(0.7, 1.4, 9)
"""The same beside the best of these"""
_LARGEST = 1.5
"""Largest factor; that of a screw which also turns, or of a parallelogram linkage, is 1."""
_MAX_REMAINING = 0.85
"""Share of the squared errors of each half, with values of the other, that the first factor leaves at most, and also
where the axis moves"""
_MAX_AGAINST = 0.7
"""The same where the motor moves against its axis: without coupling this is much more than 1, as the sign is wrong; a
factor that was twice the true one left 0.83, right ones 0.02 to 0.5"""
_MAX_FURTHER = 0.9
"""The same as for the first, for a further one"""
_MIN_EXPLAINED = 0.65
"""Least share of the torque that is explained then; a weight that is not known may look like friction in few moves."""
_MIN_WINDOWS = 3
"""Least number of separate windows in each half in which the motor moves so"""
_STANDS = 0.025
"""The axis does not clearly move below this share of its usual speed."""
_MOSTLY, _NEARLY_ALWAYS = 0.5, 0.9
"""Share of a window in which the motor moves against its axis, and in which an axis moves"""
_BLOCKS = 8
"""Number of parts of the records, each of which is left out once: how far the factors then differ is their error."""
_T = 1.895
"""Of Student's distribution with 7 degrees of freedom: 90 %"""
_MAX_ERROR = 0.25
"""Half the width of the interval of a factor is at most this share of it, .."""
_STEPS, _AS_WELL = (0.1, 0.15, 0.2, 0.25, 0.3), 1.02
""".. and at least the first of these shares of it, and the largest with which the squared errors grow by less."""
_ALIKE = 0.1
"""Half the difference between the halves of the records is less than this share of a factor that is likely."""
_DETERMINED = 1e-8


class CouplingFactor(NamedTuple):
    """A factor of the motion of another axis in that of a motor."""

    value: float
    error: float
    """Half the width of its 90 % interval"""


class MotorCoupling(NamedTuple):
    """The motions of other axes with which a motor moves."""

    factors: Mapping[str, CouplingFactor]
    """By the name of the angle of the other axis"""
    against: float
    """Share of the squared errors that they leave where the motor then moves against its axis, in each half of the
    records with values of the other half"""


def motor_coupling(
    records: Sequence[Record], others: Sequence[str], terms: Sequence[str] = (), known: Sequence[str] = ()
) -> MotorCoupling | None:
    """The coupling of the motor of an axis to the motions of other axes, one more than are known.

    Only one, as the load of links is better known with each; so it is looked for again before the next one.

    Args:
        records: of the axis, whose angle is measured and is that of the arm, with these signals.
        others: names of signals that are the angles of other axes, as they are sent [rad]; they do not wrap.
        terms: terms of the torque offset that were found, such as "cos(axis2 + axis3)".
        known: those of ``others`` that are known to move the motor; their factors are found again.

    Returns:
        The factors; None: the friction shows none, or none of the known ones clearly enough.
    """
    load = [Term.read(text) for text in terms]
    search = _search(records, others, load)
    return search.found(known) if search else None


def likely_coupling(records: Sequence[Record], others: Sequence[str]) -> MotorCoupling | None:
    """The likeliest factor of one axis, where the load of links is not known, so that friction may not show it yet.

    A large factor hides the load: it makes the friction of the motor, and what the motor takes to accelerate, follow
    another axis.  With a factor that is about right the load is found, and then ``motor_coupling`` can judge it.

    Args:
        records: as of ``motor_coupling``.
        others: as there.

    Returns:
        The factor, with half the difference between the halves of the records as its error; None: they differ.
    """
    search = _search(records, others, ())
    return search.likeliest() if search else None


def _search(records: Sequence[Record], others: Sequence[str], load: Sequence[Term]) -> _CouplingSearch | None:
    """The search in these records; None: they are too short."""
    names = dict.fromkeys((*others, *(name for term in load for name in term.signals)))
    parts, window = moving_parts(records, list(names))
    if not parts:
        return None
    scales = speed_scales(records)[:3]
    return _CouplingSearch(parts, window, (_STEEPER * scales[0], *scales), others, load)


_Factors = Mapping[str, float]
_Halves = tuple[_Factors, _Factors]
"""Factors that were fitted to each half of the windows"""
_NONE: _Halves = ({}, {})
_Where = Callable[[_Factors, _Factors], Bools]


class _CouplingSearch(WeightBalance):
    """The torque balance with the friction of a motor that moves with other axes, too.

    ``scales``: speed scales of Coulomb friction, rad/s; together they can also stand for Stribeck's friction.
    """

    def __init__(
        self,
        parts: Sequence[GridPart],
        window: int,
        scales: Sequence[float],
        others: Sequence[str],
        load: Sequence[Term],
    ) -> None:
        super().__init__(parts, window, scales[2], moving=False)
        half = window // 8
        self._scales = scales
        self._own = [speed_of(part, half) for part in parts]
        speeds = {name: [speed_of(part._replace(y=part.signals[name]), half) for part in parts] for name in others}
        usual, least = _usual(self._own), _TRIALS[0] / _LARGEST
        self._speeds = {name: speed for name, speed in speeds.items() if _usual(speed) > least * usual}
        self._unit = {name: usual / _usual(speed) for name, speed in self._speeds.items()}
        """The factor with which an axis moves the motor about as much as its own axis does"""
        self._least = _STANDS * usual
        """Speed below which the axis may stand"""
        inertia, viscous, _, offset = self.rows.T
        fixed = [inertia, viscous, offset, *(self.column(term.value(part.signals) for part in parts) for term in load)]
        for speed in self._speeds.values():
            fixed += [self.column(speed), self.rate(speed), self._coulomb(speed, scales[2])]
        self._fixed = np.column_stack(fixed)

    def found(self, known: Sequence[str]) -> MotorCoupling | None:
        """The factors of the known axes and of one more; of several, where one alone is uncertain without the next."""
        if not self._speeds.keys() >= {*known}:
            return None  # one of them hardly moves
        chosen = _NONE
        for name in known:
            chosen = self._with(chosen, name)
        known_alone = chosen
        while tried := [self._with(chosen, name) for name in self._speeds if name not in chosen[0]]:
            best = min(tried, key=self._remaining)
            if not self._is_shown(best, chosen):
                break
            chosen = best
            if (factors := self._with_errors(chosen)) is not None:
                return MotorCoupling(factors, self._remaining(chosen, where=self._against))
        factors = self._with_errors(known_alone) if known else None
        return MotorCoupling(factors, self._remaining(known_alone, where=self._against)) if factors else None

    def likeliest(self) -> MotorCoupling | None:
        """The factor that leaves least, shown or not, if it is about the same in both halves."""
        best = min((self._with(_NONE, name) for name in self._speeds), key=self._remaining, default=_NONE)
        for name, first in best[0].items():
            value, error = (first + best[1][name]) / 2, abs(first - best[1][name]) / 2
            if error < _ALIKE * abs(value) <= _ALIKE * _LARGEST:
                return MotorCoupling({name: CouplingFactor(value, error)}, self._remaining(best, where=self._against))
        return None

    def _is_shown(self, factors: _Halves, before: _Halves) -> bool:
        """Whether these factors explain clearly more than those before, of which these have one more."""
        most = _MAX_FURTHER if before[0] else _MAX_REMAINING
        return (
            max(self._remaining(factors, before), self._remaining(factors, before, self._moving)) < most
            and (bool(before[0]) or self._remaining(factors, where=self._against) < _MAX_AGAINST)
            and self._explained(factors) > _MIN_EXPLAINED
        )

    def _remaining(self, factors: _Halves, before: _Halves = _NONE, where: _Where | None = None) -> float:
        """The share of the squared errors with factors ``before`` that these leave, in the half where it is larger.

        Each half is judged with the factors of the other half, and values that were fitted there.  ``where``: gives the
        windows to judge by, for both factors; 1: these are too few.
        """
        found = list[float]()
        for fitted, judged, new, old in zip(self.halves, self.halves[::-1], factors, before, strict=True):
            used = where(new, old)[judged] if where else slice(None)
            left, left_before = (self._errors(f, fitted)[judged][used] for f in (new, old))
            before_squared = float(left_before @ left_before)
            if len(left) < WINDOWS * _MIN_WINDOWS or before_squared <= 0:
                return 1.0
            found.append(float(left @ left) / before_squared)
        return max(found)

    def _explained(self, factors: _Halves) -> float:
        """The share of the torque that is explained in each half, with values of the other half."""
        halves = zip(self.halves, self.halves[::-1], factors, strict=True)
        return self.share_explained(
            sum(float(e @ e) for fitted, judged, new in halves for e in [self._errors(new, fitted)[judged]])
        )

    def _moving(self, _factors: _Factors, _before: _Factors) -> Bools:
        """In which windows (M,) the axis moves."""
        return self._share(abs(own) > self._least for own in self._own) > _NEARLY_ALWAYS

    def _against(self, factors: _Factors, before: _Factors) -> Bools:
        """In which windows (M,) the motor moves one way with these factors, and the other way without them."""
        pairs = zip(self._motor(factors), self._motor(before), strict=True)
        least = self._least
        return self._share((abs(new) > least) & (abs(old) > least) & (new * old < 0) for new, old in pairs) > _MOSTLY

    def _share(self, masks: Iterable[Bools]) -> Floats:
        """The share of each window (M,) in which a mask (N,) of the samples of each part holds."""
        return self.mean(mask.astype(float) for mask in masks)

    def _motor(self, factors: _Factors) -> list[Floats]:
        """Speed of the motor (N,) in each part."""
        return [
            np.asarray(sum((c * self._speeds[name][k] for name, c in factors.items()), own))
            for k, own in enumerate(self._own)
        ]

    def _with(self, chosen: _Halves, name: str) -> _Halves:
        """The factors with that of a further axis, from each half."""
        return self._added(chosen[0], name, self.halves[0]), self._added(chosen[1], name, self.halves[1])

    def _added(self, factors: _Factors, name: str, fitted: slice) -> _Factors:
        def best_of(trials: Floats) -> float:
            errors = [self._errors({**factors, name: c}, fitted)[fitted] for c in trials.tolist()]
            return float(trials[int(np.argmin([e @ e for e in errors]))])

        trials = self._unit[name] * np.concatenate([-_TRIALS, _TRIALS])
        best = best_of(trials[abs(trials) <= _LARGEST])
        return self._refined({**factors, name: best_of(best * _NEAR)}, fitted)

    def _refined(self, factors: _Factors, fitted: slice | Bools) -> _Factors:
        """The factors that leave the least errors where they are fitted, near these."""
        names, unit = list(factors), np.array([self._unit[name] for name in factors])

        def errors(x: Floats) -> Floats:
            return self._errors(dict(zip(names, (x * unit).tolist(), strict=True)), fitted)[fitted]

        start = np.array(list(factors.values())) / unit
        found = least_squares(errors, start, x_scale=0.1, diff_step=[1e-3], max_nfev=20).x
        return dict(zip(names, (found * unit).tolist(), strict=True))

    def _with_errors(self, halves: _Halves) -> Mapping[str, CouplingFactor] | None:
        """The factors by all windows, with their errors; None: one of them is too large or too uncertain."""
        every = np.ones(len(self.torque), np.bool_)
        best = self._refined(halves[0], every)
        block = np.arange(len(every)) * _BLOCKS // len(every)
        left_out = [self._refined(best, block != k) for k in range(_BLOCKS)]
        factors = dict[str, CouplingFactor]()
        for name, value in best.items():
            jackknife = float(np.std([other[name] for other in left_out])) * float(np.sqrt(_BLOCKS - 1))
            error = _T * max(jackknife, abs(halves[0][name] - halves[1][name]) / 2)
            error = max(error, self._undetermined(best, name))
            if abs(value) > _LARGEST or error > _MAX_ERROR * abs(value):
                return None
            factors[name] = CouplingFactor(value, error)
        return factors

    def _undetermined(self, best: _Factors, name: str) -> float:
        """How far a factor may be from the best one, either way, for the records that explain as well with it.

        Axes that start and stop together move in fixed proportions, so in a few moves all factors within a range
        reverse friction in the same moves.
        """
        every = np.ones(len(self.torque), np.bool_)
        least = np.sum(self._errors(best, every) ** 2)
        steps = [
            step
            for step in _STEPS
            for value in (best[name] * (1 - step), best[name] * (1 + step))
            if np.sum(self._errors({**best, name: value}, every) ** 2) < _AS_WELL * least
        ]
        return max(_STEPS[0], *steps, 0.0) * abs(best[name])

    def _errors(self, factors: _Factors, fitted: slice | Bools) -> Floats:
        """The torque (M,) that is not explained with these factors and values that are fitted to these windows."""
        motor = self._motor(factors)
        rows = of_unit_length(np.column_stack([self._fixed, *(self._coulomb(motor, scale) for scale in self._scales)]))
        values = np.linalg.lstsq(rows[fitted], self.torque[fitted], rcond=_DETERMINED)[0]
        return np.asarray(self.torque - rows @ values)

    def _coulomb(self, speeds: Sequence[Floats], scale: float) -> Floats:
        return self.column(np.tanh(speed / scale) for speed in speeds)


def _usual(speeds: Sequence[Floats]) -> float:
    """Root mean square of speeds, of the parts together."""
    return float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
