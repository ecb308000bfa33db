"""Finds the links of an arm that load an axis: cosines and sines of sums of joint angles in its torque.

The potential energy of a serial arm is a sum of products of cosines and sines of its joint angles, and so of cosines
and sines of their sums and differences.  The weight that an axis holds is its derivative by the angle of that axis:
terms without that angle drop out.  The zero and the direction of each joint angle do not matter: each sum is tried with
both signs of the other angles, and with cosine and sine.

    J w' + f w + fc sign(w) + tau0 + sum_i (c_i cos s_i + d_i sin s_i) = u,    s_i = q_own +- q_j +- q_k

A measured load, as that of a hoist or of a gripper, is a further term, or a factor of these terms.  The acceleration of
another axis is a further term: if links are dynamically coupled, accelerating one needs a torque on the other, too.

Terms are chosen by cross-validation: the values are fitted to one half of the data, and the error is that of the other
half, and vice versa.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from copy import copy
from functools import partial
from itertools import combinations, product
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Factor, Term
from monitor_core.identification.records.measured_record import Record
from monitor_core.identification.torque_balance.rigid_body import speed_scales
from monitor_core.identification.torque_balance.torque_windows import GridPart, leaves_much_less
from monitor_core.identification.weight.arm_chain import MOST_AXES, ChainBalance, arm_chain
from monitor_core.identification.weight.arm_energies import AngleSum, MotionSignals, possible_energies
from monitor_core.identification.weight.link_energies import AnyEnergy, EnergyBalance, LinkEnergies, link_energies
from monitor_core.identification.weight.pose_polynomials import PoseEnergy
from monitor_core.identification.weight.weight_balance import (
    MIN_INCREASE,
    MOST_OTHERS,
    WeightBalance,
    moving_parts,
    slow_parts,
)

_MOST_SUMS = 8
_MAX_REMAINING = 0.6
"""A further sum must reduce the squared errors to at most this share, .."""
_MIN_GAIN = 0.01
""".. or, if there are other terms already, explain at least this share of the variance of the torque: at the bending
axis of a wrist a weight is the sum of many terms."""
_CLEARLY_LESS = 0.9
"""An alternative, as a sum of more angles, is used if it leaves at most this share of the squared errors."""
_MIN_EXPLAINED = 0.5
"""Least share of the torque that must be explained; otherwise no weights are reported."""

_MIN_VARIANCE = 0.003
"""Least share of the variance of the torque that the weights explain; less may be an error of the friction model."""


class ArmSignals(NamedTuple):
    """Names of the signals in the records of an axis, by what they may be for the arm that it belongs to."""

    own: str
    """The angle of the axis itself [rad]"""
    angles: Sequence[str]
    """All angles of the arm [rad], own too, from the base to the hand; none: no weight of links is looked for"""
    loads: Sequence[str] = ()
    """Signals that may be loads"""
    accelerations: Sequence[str] = ()
    """The accelerations of other axes [rad/s^2]"""
    moving: Mapping[str, MotionSignals] = MappingProxyType({})
    """Of angles that do not wrap, own too, the signals of their speed and acceleration; records need not have these.

    The torque of kinetic energies is then looked for, too: of the own angle alone that of the inertia of a load, and of
    what is not in ``angles``, as the angle of the motor of a linear axis, that of a coupling which follows no pose.
    """
    of_arm: Collection[str] = ()
    """Angles that are those of the arm in any case, not those of motors before their gears"""


class LinkWeights(NamedTuple):
    """The terms of the load on an axis, and how well they explain its torque."""

    terms: tuple[str, ...]
    """"cos(axis2 + axis3)", "axis2-acceleration", "payload", .."""
    explained: float
    """part of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these terms"""
    undetermined: tuple[str, ...] = ()
    """further angles that the load may follow as well: the records do not tell"""

    @property
    def explains_much_more(self) -> bool:
        """Whether much less of the torque remains than without these terms."""
        return leaves_much_less(self.explained, self.before)

    @property
    def explains_clearly_more(self) -> bool:
        """Whether clearly less of the torque remains than without these terms, though perhaps not much less."""
        return (1 - self.explained) ** 2 < _CLEARLY_LESS * (1 - self.before) ** 2

    @property
    def signals(self) -> set[str]:
        """Names of the signals in the terms."""
        return {signal for term in self.terms for signal in Term.read(term).signals}


def link_weights(records: Sequence[Record], signals: ArmSignals) -> LinkWeights | None:
    """The weights, and the motion of other axes, in the torque of an axis; None: they do not explain it.

    ``records``: of the axis, whose angle is measured, with these signals.
    """
    found = _weights(records, signals)
    if found is None:
        return None
    if signals.own in signals.moving and (len(signals.moving) > 1 or signals.loads):
        found = _with_energies(found, records, signals)
    enough = (1 - found.before) ** 2 - (1 - found.explained) ** 2 >= _MIN_VARIANCE
    return found if found.terms and enough and found.explained >= _MIN_EXPLAINED else None


def _weights(records: Sequence[Record], signals: ArmSignals) -> LinkWeights | None:
    """The weights, loads and accelerations alone; None: the records are too short."""
    accelerations = [_plain(name) for name in signals.accelerations]
    parts, window = slow_parts(records, (*signals.angles, *signals.loads, *signals.accelerations))
    if not parts:
        return None
    balance = _LinkBalance(parts, window, speed_scales(records)[1], signals.own, signals.angles)
    before = balance.explained(())
    balance = balance.coupled_with(accelerations)
    chosen = _chosen(balance, signals)
    balance = balance.without_needless(chosen)
    if not chosen and not balance.coupled:
        return LinkWeights((), before, before)
    needed = balance.needed(chosen)
    balance = balance.with_positive_inertia(needed, accelerations)
    return LinkWeights(tuple(map(str, (*needed, *balance.coupled))), balance.explained(needed), before)


def _chosen(balance: _LinkBalance, signals: ArmSignals) -> list[Term]:
    """The weights and loads that reduce the error: without a carried load, or with the one that explains clearly more.

    Without angles, only the loads.
    """
    if not signals.angles:
        return _with_loads(balance, [], [], signals.loads)
    alone = _cosines_and_sines([((1, signals.own),)])

    def with_carried(load: Term | None) -> list[Term]:
        return _with_loads(balance, _cosines_and_sines(balance.sums(load), load), alone, signals.loads)

    chosen = with_carried(None)
    for load in signals.loads:
        carrying = with_carried(_plain(load))
        if balance.error(carrying) < _CLEARLY_LESS * balance.error(chosen):
            chosen = carrying
    return chosen


def _with_energies(found: LinkWeights, records: Sequence[Record], signals: ArmSignals) -> LinkWeights:
    """These terms with the torques of energies, of the arm alone or also of a carried load; else as they are."""
    own, moving = signals.own, signals.moving
    terms = [Term.read(text) for text in found.terms]
    parts, window = moving_parts(records, [*moving, *signals.loads, *(name for term in terms for name in term.signals)])
    if not parts:
        return found
    values = [np.concatenate([_values(term, part) for part in parts]) for term in terms]
    arm = [angle for angle in signals.angles if angle in moving]
    beside = [angle for angle in moving if angle not in arm and angle != own]
    balance = partial(EnergyBalance, parts, window, speed_scales(records)[1], own)
    best, energies = terms, None
    if len(moving) > 1:
        energies = link_energies(balance(possible_energies(own, arm, beside), values))
    chained = _energies_of_chain(records, signals, arm)
    if chained is not None:
        # The sums that were found without the chain stand for its weights, so the search begins anew.
        linked = link_energies(balance((*chained(""), *possible_energies(own, arm, beside)), []))
        if energies is None or _leaves_clearly_less(linked, energies):
            best, energies = [], linked
    for load in signals.loads:
        # Terms that were found without the energies of the load stand for them, so the search begins anew.
        possible: Sequence[AnyEnergy] = possible_energies(own, arm, beside, load)
        if chained is not None:
            possible = (*chained(""), *chained(load), *possible)
        carrying = link_energies(balance(possible, []))
        if energies is None or _leaves_clearly_less(carrying, energies):
            best, energies = [], carrying
    if energies is None or not energies.found:
        return found
    # An acceleration stays, as it may be there for a positive inertia.
    needed = [term for k, term in enumerate(best) if k not in energies.needless or not term.turns]
    torques = [energy.torque(own, moving) for energy in energies.found]
    return LinkWeights(
        tuple(dict.fromkeys(map(str, (*needed, *torques)))),
        energies.explained,
        min(found.before, energies.before),
        energies.undetermined,
    )


def _leaves_clearly_less(found: LinkEnergies, other: LinkEnergies) -> bool:
    return (1 - found.explained) ** 2 < _CLEARLY_LESS * (1 - other.explained) ** 2


def _energies_of_chain(
    records: Sequence[Record], signals: ArmSignals, arm: Sequence[str]
) -> Callable[[str], Sequence[PoseEnergy]] | None:
    """Energies of an arm with a wrist, also times a load, whose axes follow each other as its weight shows.

    None: the arm has no wrist, or its weight shows nothing.
    """
    if signals.own not in arm or not MOST_OTHERS + 1 < len(arm) <= MOST_AXES:
        return None
    parts, window = slow_parts(records, (*arm, *signals.accelerations))
    if not parts:
        return None
    balance = ChainBalance(parts, window, speed_scales(records)[1], signals.own, arm, signals.accelerations)
    chain = arm_chain(balance)
    return None if chain is None else partial(balance.energies, chain)


def _with_loads(
    balance: _LinkBalance, chosen: Sequence[Term], alone: Sequence[Term], loads: Sequence[str]
) -> list[Term]:
    """The chosen terms, with measured loads that reduce the error: as terms of their own, or as factors of weights.

    ``alone``: the weights of the axis itself, which may be visible only together with a load.
    """
    found = list(chosen)

    def error_with(more: Sequence[Term]) -> float:
        return balance.error([*found, *more])

    for load in map(_plain, loads):
        turning = [Term.product(*load.factors, *term.factors) for term in dict.fromkeys((*found, *alone))]
        options = ([load], turning, *([term] for term in turning))
        missing = [term for term in alone if term not in found]
        best = min(options, key=error_with)
        fuller = min(([*option, *missing] for option in options), key=error_with)
        if error_with(fuller) < _MAX_REMAINING * error_with(best):
            best = fuller
        if error_with(best) < _MAX_REMAINING * error_with(()):
            found += best
    return found


def _values(term: Term, part: GridPart) -> Floats:
    """A term that is one product, of loads and of cosines or sines of sums of angles (N,).

    Whole arrays at once, as many candidates are tried; ``Term.value`` takes value by value, for equal bits in replays.
    """
    values = np.ones(len(part.u))
    for factor in term.factors:
        total = sum((sign * part.signals[name] for sign, name in factor.addends), np.zeros(len(part.u)))
        values = values * _FUNCTIONS[factor.function](total)
    return values


_FUNCTIONS: Mapping[str, Callable[[Floats], Floats]] = MappingProxyType({"cos": np.cos, "sin": np.sin, "": np.asarray})


def _cosines_and_sines(sums: Iterable[AngleSum], load: Term | None = None) -> list[Term]:
    """Cosine and sine of each of these sums of angles, also times the load that is carried, if any."""
    own = [Term.product(Factor(function, angles)) for angles in sums for function in ("cos", "sin")]
    return own if load is None else [*own, *(Term.product(*load.factors, *term.factors) for term in own)]


def _plain(signal: str) -> Term:
    return Term.product(Factor("", ((1, signal),)))


class _LinkBalance(WeightBalance):
    """The torque balance with further terms, fitted to each half of the equations and tested on the other half.

    ``own`` and ``angles`` as in ``ArmSignals``.  ``coupled``: the accelerations of other axes that are in all
    equations; another choice of them is another balance.
    """

    def __init__(self, parts: Sequence[GridPart], window: int, scale: float, own: str, angles: Sequence[str]) -> None:
        super().__init__(parts, window, scale)
        self._own, self._angles = own, angles
        self._columns: dict[Term, Floats] = {}
        self.coupled: tuple[Term, ...] = ()

    def _with(self, coupled: Sequence[Term]) -> _LinkBalance:
        """The balance with these accelerations; both share the columns that are known."""
        balance = copy(self)
        balance.coupled = tuple(coupled)
        return balance

    def coupled_with(self, accelerations: Iterable[Term]) -> _LinkBalance:
        """The balance with those accelerations of other axes that reduce the error, added one by one.

        This comes before the search for weights, which a torque that changes so much faster would hide.
        """
        balance, left, missing = self, self.error(()), list(accelerations)
        while missing:
            best = min(missing, key=lambda term: balance.error([term]))
            if not balance._is_needed(least := balance.error([best]), left, 1, True):
                break
            balance, left = balance._with((*balance.coupled, best)), least
            missing.remove(best)
        return balance

    def without_needless(self, terms: Sequence[Term]) -> _LinkBalance:
        """The balance without the accelerations that explain nothing in addition to these terms."""
        balance = self
        for term in self.coupled:
            fewer = balance._with([other for other in balance.coupled if other != term])
            if not fewer._is_needed(balance.error(terms), fewer.error(terms), 1, True):
                balance = fewer
        return balance

    def needed(self, terms: Sequence[Term]) -> Sequence[Term]:
        """Those of these terms that explain something beside the others; one at least, unless an axis is coupled."""
        needed, left = terms, self.error(terms)
        for term in terms:
            fewer = [other for other in needed if other != term]
            if (fewer or self.coupled) and self.error(fewer) < MIN_INCREASE * left:
                needed = fewer
        return needed

    def with_positive_inertia(self, terms: Sequence[Term], accelerations: Sequence[Term]) -> _LinkBalance:
        """The balance with the fewest further accelerations that make a negative inertia beside these terms positive.

        If axes move together, as in a program, the torque for the acceleration of another axis is attributed to the
        inertia of this one.  At a wrist it is larger than that of the inertia, and has the opposite sign.  So it is
        needed even if it explains little of the torque.
        """
        if max(self.inertias(self._columns_of(terms))) >= 0:
            return self
        missing = [term for term in accelerations if term not in self.coupled]
        for count in range(1, len(missing) + 1):
            trials = [self._with((*self.coupled, *more)) for more in combinations(missing, count)]
            positive = [trial for trial in trials if min(trial.inertias(trial._columns_of(terms))) > 0]
            best = min(positive, key=lambda trial: trial.error(terms), default=self)
            if best.error(terms) < self.error(terms):
                return best
        return self

    def sums(self, load: Term | None) -> list[AngleSum]:
        """Sums of angles, added one by one as long as the next one reduces the error.

        ``load``: a measured one that is tried as a factor of each weight: a load that varies would hide the weights.
        Two links may hide each other, so pairs are tried if no single sum explains enough.  A sum that was chosen
        before a later one is exchanged if another one is better together with that.
        """
        chosen = list[AngleSum]()
        left = self.error(())
        while len(chosen) < _MOST_SUMS:
            best, least = self._best(chosen, load)
            if not self._is_needed(least, left, 1, bool(chosen)):
                near = [*self._sums(0), *self._sums(1)]
                beside = [(self._best([*chosen, first], load), first) for first in near]
                (best, least), first = min(beside, key=lambda pair: pair[0][1])
                if first in chosen or not self._is_needed(least, left, 2, bool(chosen)):
                    break
                chosen = [*chosen, first]
            chosen, left = [*chosen, best], least
            for place in range(len(chosen) - 1):
                others = [*chosen[:place], *chosen[place + 1 :]]
                best, least = self._best(others, load)
                if least < _CLEARLY_LESS * left:
                    chosen, left = [*others, best], least
        return chosen

    def _best(self, chosen: Sequence[AngleSum], load: Term | None) -> tuple[AngleSum, float]:
        """The sum that explains most in addition to others, and the error; of few angles, if possible."""
        best: AngleSum = ()
        least = np.inf
        for count in range(MOST_OTHERS + 1):
            tried = [angles for angles in self._sums(count) if angles not in chosen]
            with_it = [self.error(_cosines_and_sines([*chosen, angles], load)) for angles in tried]
            if with_it and min(with_it) < _CLEARLY_LESS * least:
                least, best = min(with_it), tried[int(np.argmin(with_it))]
        return best, least

    def _sums(self, count: int) -> Iterator[AngleSum]:
        """Sums of the own angle and so many others: a plus sign for the first one, either sign for the others."""
        others = [name for name in self._angles if name != self._own]
        for names in combinations(others, count):
            used = [name for name in self._angles if name == self._own or name in names]
            for signs in product((1, -1), repeat=count):
                yield tuple(zip((1, *signs), used, strict=True))

    def error(self, terms: Sequence[Term]) -> float:
        """Sum of squared errors of each half of the equations with values that were fitted to the other half."""
        columns = self._columns_of(terms)
        first, last = self.halves
        return self.missed(columns, first, last) + self.missed(columns, last, first)

    def explained(self, terms: Sequence[Term]) -> float:
        """Share of the torque about its mean that is explained where it was not fitted."""
        return self.share_explained(self.error(terms))

    def _is_needed(self, least: float, left: float, sums: int, beside: bool) -> bool:
        """Whether so many further terms reduce the error enough; ``beside``: there are other terms already."""
        return least < _MAX_REMAINING**sums * left or (
            (beside or bool(self.coupled)) and left - least > sums * _MIN_GAIN * self.spread
        )

    def _columns_of(self, terms: Sequence[Term]) -> list[Floats]:
        """Columns of these terms and of the accelerations."""
        return [self._column(term) for term in (*terms, *self.coupled)]

    def _column(self, term: Term) -> Floats:
        if term not in self._columns:
            self._columns[term] = self.column(_values(term, part) for part in self._parts)
        return self._columns[term]
