"""Which links of an arm load an axis: cosines and sines of sums of joint angles that its torque shows.

The potential energy of a serial arm is a sum of products of cosines and sines of its joint angles, and so of cosines
and sines of their sums and differences.  The weight that an axis holds is its derivative by the angle of that axis:
terms without that angle drop out.  How the joints are counted, from where, and in which direction, does not matter:
each sum comes with both signs of the other angles, and each with cosine and sine.

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u,    s_i = q_own +- q_j +- q_k

A measured load, as that of a hoist or of a gripper, adds itself, or multiplies these terms.  So does the acceleration
of another axis: where the links of an arm are coupled, one cannot be accelerated without a torque of the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, product
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Factor, Term
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import GridPart
from monitor_core.identification.weight.weight_balance import WeightBalance, slow_parts

_MOST_OTHERS = 2
"""Other angles in a sum: shoulder, elbow and a wrist that bends in the same plane."""
_MOST_SUMS = 8
_LESS = 0.6
"""Of the squared errors on what was not fitted: another sum leaves at most so much of them,"""
_MORE = 0.01
"""or, where a weight or another axis shows already, explains so much of the variance of the torque: on the bending axis
of a wrist a weight is the sum of many."""
_SIMPLER = 0.9
"""A sum of more angles leaves at most so much of what the best one of fewer leaves."""
_NEEDED = 1.02
"""Without a single cosine or sine that is needed, the squared errors are at least so many times as large."""
_EXPLAINS = 0.5
"""Part of the torque that is explained where it was not fitted, or the weights are none."""

_MATTERS = 0.003
"""Part of the variance of the torque that weights explain, or they are what friction lacks."""

Sum = tuple[tuple[int, str], ...]
"""A sum of angles, by the names of their signals, each with its sign"""


class LinkWeights(NamedTuple):
    """What loads an axis."""

    terms: tuple[str, ...]
    """"cos(axis2 + axis3)", "payload", .."""
    explained: float
    """part of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these terms"""


def link_weights(
    records: Sequence[Record],
    own: str,
    angles: Sequence[str],
    loads: Sequence[str] = (),
    accelerations: Sequence[str] = (),
) -> LinkWeights | None:
    """The weights, and accelerations of others, that the torque of an axis shows; None: none that explains it.

    Args:
        records: of the axis, whose angle is measured, with the angles of the arm's axes as signals [rad].
        own: name of the signal that is the angle of the axis itself.
        angles: names of all of them, own too, from the base to the hand; none: not looked for.
        loads: names of signals that may be loads.
        accelerations: names of signals that are those of other axes.
    """
    parts, window = slow_parts(records, (*angles, *loads, *accelerations))
    if not parts:
        return None
    balance = _Balance(parts, window, speed_scales(records)[1], own, angles)
    before = balance.explained(())
    balance.couple(map(_plain, accelerations))
    alone = _waves(((1, own),)) if angles else []
    chosen = _with_loads(balance, _waves(*(balance.sums() if angles else ())), alone, loads)
    for load in loads if angles else ():
        balance.carried = _plain(load)
        carrying = _with_loads(balance, balance.waves(*balance.sums()), alone, loads)
        if balance.left(carrying) < _SIMPLER * balance.left(chosen):
            chosen = carrying
    balance.uncouple(chosen)
    if not chosen and not balance.coupled:
        return None
    needed, left = chosen, balance.left(chosen)
    for wave in chosen:
        fewer = [w for w in needed if w != wave]
        if (fewer or balance.coupled) and balance.left(fewer) < _NEEDED * left:
            needed = fewer
    balance.couple_for_inertia(needed, [_plain(name) for name in accelerations])
    explained = balance.explained(needed)
    if explained < _EXPLAINS or (1 - before) ** 2 - (1 - explained) ** 2 < _MATTERS:
        return None
    return LinkWeights(tuple(map(str, (*needed, *balance.coupled))), explained, before)


def _with_loads(
    balance: _Balance, chosen: Sequence[Term], alone: Sequence[Term], loads: Sequence[str]
) -> list[Term]:
    """With loads that explain what was not fitted: each adds itself, or multiplies weights.

    ``alone``: the weights of the axis itself, which may show only beside a load.
    """
    found = list(chosen)

    def left(more: Sequence[Term]) -> float:
        return balance.left([*found, *more])

    for load in map(_plain, loads):
        turning = [Term((*load.factors, *wave.factors)) for wave in dict.fromkeys((*found, *alone))]
        options = ([load], turning, *([term] for term in turning))
        missing = [wave for wave in alone if wave not in found]
        best = min(options, key=left)
        fuller = min(([*option, *missing] for option in options), key=left)
        if left(fuller) < _LESS * left(best):
            best = fuller
        if left(best) < _LESS * left(()):
            found += best
    return found


def _values(wave: Term, part: GridPart) -> Floats:
    """A product of loads and of cosines or sines of sums of angles (N,)."""
    values = np.ones(len(part.u))
    for factor in wave.factors:
        total = sum((sign * part.signals[name] for sign, name in factor.addends), np.zeros(len(part.u)))
        values = values * _FUNCTIONS[factor.function](total)
    return values


_FUNCTIONS: Mapping[str, Callable[[Floats], Floats]] = MappingProxyType(
    {"cos": np.cos, "sin": np.sin, "": np.asarray}
)


def _waves(*sums: Sum) -> list[Term]:
    return [Term((Factor(function, angles),)) for angles in sums for function in ("cos", "sin")]


def _plain(signal: str) -> Term:
    return Term((Factor("", ((1, signal),)),))


class _Balance(WeightBalance):
    """The torque balance with waves beside it: fitted to each half, and tried on the other.

    ``own`` and ``angles`` as in ``link_weights``.
    """

    def __init__(
        self, parts: Sequence[GridPart], window: int, scale: float, own: str, angles: Sequence[str]
    ) -> None:
        super().__init__(parts, window, scale)
        self._own, self._angles = own, angles
        self._columns: dict[Term, Floats] = {}
        self._spread = float(((self.torque - self.torque.mean()) ** 2).sum())
        self.coupled: tuple[Term, ...] = ()
        self.carried: Term | None = None
        """A load that is tried with each weight: as it comes and goes, it hides the weights that it hangs on"""

    def waves(self, *sums: Sum) -> list[Term]:
        """The weights that turn with these sums of angles, each also times the load that is carried, if any."""
        own = _waves(*sums)
        load = () if self.carried is None else self.carried.factors
        return [*own, *(Term((*load, *wave.factors)) for wave in own if load)]

    def couple(self, accelerations: Iterable[Term]) -> None:
        """Put the accelerations of other axes beside all terms that explain what was not fitted.

        They come before the weights, which would not show beside a torque that changes so much faster.
        """
        left, missing = self.left(()), list(accelerations)
        while missing:
            best = min(missing, key=lambda term: self.left([term]))
            if not self._matters(least := self.left([best]), left, 1, True):
                break
            left = least
            self.coupled += (best,)
            missing.remove(best)

    def uncouple(self, waves: Sequence[Term]) -> None:
        """Remove the accelerations that explain nothing in addition to these terms."""
        for term in self.coupled:
            left, every = self.left(waves), self.coupled
            self.coupled = tuple(other for other in every if other != term)
            if self._matters(left, self.left(waves), 1, True):
                self.coupled = every

    def couple_for_inertia(self, waves: Sequence[Term], accelerations: Sequence[Term]) -> None:
        """Add the fewest accelerations with which the inertia is positive, if it is negative beside these terms.

        Where axes move together, as in a program, what accelerates another one hides in the inertia of this one: at a
        wrist it is more than that, and has the other sign.  So it matters even where it explains little of the torque.
        """
        if max(self.inertias(self._further(waves))) >= 0:
            return
        left, before = self.left(waves), self.coupled
        missing = [term for term in accelerations if term not in before]
        for count in range(1, len(missing) + 1):
            trials = dict[float, tuple[Term, ...]]()
            for more in combinations(missing, count):
                self.coupled = (*before, *more)
                if min(self.inertias(self._further(waves))) > 0:
                    trials[self.left(waves)] = self.coupled
            if trials and min(trials) < left:
                self.coupled = trials[min(trials)]
                return
        self.coupled = before

    def sums(self) -> list[Sum]:
        """Sums of angles, one after the other, as long as the next one explains what was not fitted.

        Two links may hide each other, so a second one is looked for where the first alone explains little.  A sum that
        was chosen while another one was missing is exchanged for what is better beside that one.
        """
        chosen = list[Sum]()
        left = self.left(())
        while len(chosen) < _MOST_SUMS:
            best, least = self._best(chosen)
            if not self._matters(least, left, 1, bool(chosen)):
                near = [*self._sums(0), *self._sums(1)]
                beside = [(self._best([*chosen, first]), first) for first in near]
                (best, least), first = min(beside, key=lambda pair: pair[0][1])
                if first in chosen or not self._matters(least, left, 2, bool(chosen)):
                    break
                chosen = [*chosen, first]
            chosen, left = [*chosen, best], least
            for place in range(len(chosen) - 1):
                others = [*chosen[:place], *chosen[place + 1 :]]
                best, least = self._best(others)
                if least < _SIMPLER * left:
                    chosen, left = [*others, best], least
        return chosen

    def _best(self, chosen: Sequence[Sum]) -> tuple[Sum, float]:
        """The sum that explains most beside others, and what is left; of fewer angles, unless more explain more."""
        best: Sum = ()
        least = np.inf
        for count in range(_MOST_OTHERS + 1):
            tried = [angles for angles in self._sums(count) if angles not in chosen]
            with_it = [self.left(self.waves(*chosen, angles)) for angles in tried]
            if with_it and min(with_it) < _SIMPLER * least:
                least, best = min(with_it), tried[int(np.argmin(with_it))]
        return best, least

    def _sums(self, count: int) -> Iterator[Sum]:
        """The own angle with so many others, the first one with a plus, the others with either sign."""
        others = [name for name in self._angles if name != self._own]
        for names in combinations(others, count):
            used = [name for name in self._angles if name == self._own or name in names]
            for signs in product((1, -1), repeat=count):
                yield tuple(zip((1, *signs), used, strict=True))

    def left(self, waves: Sequence[Term]) -> float:
        """Sum of squared errors in each half with values of the other one."""
        columns = self._further(waves)
        first, last = slice(len(self.torque) // 2), slice(len(self.torque) // 2, None)
        return self.missed(columns, first, last) + self.missed(columns, last, first)

    def explained(self, waves: Sequence[Term]) -> float:
        """Part of the torque about its mean."""
        return 1 - float(np.sqrt(self.left(waves) / self._spread)) if self._spread > 0 else 0.0

    def _matters(self, least: float, left: float, sums: int, beside: bool) -> bool:
        """Whether so many more sums leave little enough of the squared errors; ``beside``: of others."""
        return least < _LESS**sums * left or (
            (beside or bool(self.coupled)) and left - least > sums * _MORE * self._spread
        )

    def _further(self, waves: Sequence[Term]) -> list[Floats]:
        """Columns of these terms and of the accelerations."""
        return [self._column(wave) for wave in (*waves, *self.coupled)]

    def _column(self, wave: Term) -> Floats:
        if wave not in self._columns:
            self._columns[wave] = self.column(_values(wave, part) for part in self._parts)
        return self._columns[wave]
