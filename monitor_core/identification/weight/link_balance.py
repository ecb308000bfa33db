"""The torque balance of an axis with terms of the load of links, rated by cross-validation.

The values are fitted to one half of the data, and the error is that of the other half, and vice versa.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from itertools import combinations, product
from types import MappingProxyType

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Factor, Term
from monitor_core.identification.torque_balance.torque_windows import GridPart
from monitor_core.identification.weight.arm_energies import AngleSum
from monitor_core.identification.weight.weight_balance import (
    MIN_INCREASE,
    MOST_OTHERS,
    WeightBalance,
)

_MOST_SUMS = 8
MAX_REMAINING = 0.6
"""A further sum must reduce the squared errors to at most this share, .."""
_MIN_GAIN = 0.01
""".. or, if there are other terms already, explain at least this share of the variance of the torque: at the bending
axis of a wrist a weight is the sum of many terms."""
CLEARLY_LESS = 0.9
"""An alternative, as a sum of more angles, is used if it leaves at most this share of the squared errors."""


def term_values(term: Term, part: GridPart) -> Floats:
    """A term that is one product, of loads and of cosines or sines of sums of angles (N,).

    Whole arrays at once, as many candidates are tried; ``Term.value`` takes value by value, for equal bits in replays.
    """
    values = np.ones(len(part.u))
    for factor in term.factors:
        total = sum((sign * part.signals[name] for sign, name in factor.addends), np.zeros(len(part.u)))
        values = values * _FUNCTIONS[factor.function](total)
    return values


_FUNCTIONS: Mapping[str, Callable[[Floats], Floats]] = MappingProxyType({"cos": np.cos, "sin": np.sin, "": np.asarray})


def cosines_and_sines(sums: Iterable[AngleSum], load: Term | None = None) -> list[Term]:
    """Cosine and sine of each of these sums of angles, also times the load that is carried, if any."""
    own = [Term.product(Factor(function, angles)) for angles in sums for function in ("cos", "sin")]
    return own if load is None else [*own, *(Term.product(*load.factors, *term.factors) for term in own)]


def plain_term(signal: str) -> Term:
    """The signal itself as a term."""
    return Term.product(Factor("", ((1, signal),)))


class LinkBalance(WeightBalance):
    """The torque balance with further terms, fitted to each half of the equations and tested on the other half.

    ``own`` and ``angles`` as in ``ArmSignals``.  ``coupled``: the accelerations of other axes that are in all
    equations; another choice of them is another balance.
    """

    def __init__(self, parts: Sequence[GridPart], window: int, scale: float, own: str, angles: Sequence[str]) -> None:
        super().__init__(parts, window, scale)
        self._own, self._angles = own, angles
        self._columns: dict[Term, Floats] = {}
        self.coupled: tuple[Term, ...] = ()

    def _with(self, coupled: Sequence[Term]) -> LinkBalance:
        """The balance with these accelerations; both share the columns that are known."""
        balance = copy(self)
        balance.coupled = tuple(coupled)
        return balance

    def coupled_with(self, accelerations: Iterable[Term]) -> LinkBalance:
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

    def without_needless(self, terms: Sequence[Term]) -> LinkBalance:
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

    def with_positive_inertia(self, terms: Sequence[Term], accelerations: Sequence[Term]) -> LinkBalance:
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
                if least < CLEARLY_LESS * left:
                    chosen, left = [*others, best], least
        return chosen

    def _best(self, chosen: Sequence[AngleSum], load: Term | None) -> tuple[AngleSum, float]:
        """The sum that explains most in addition to others, and the error; of few angles, if possible."""
        best: AngleSum = ()
        least = np.inf
        for count in range(MOST_OTHERS + 1):
            tried = [angles for angles in self._sums(count) if angles not in chosen]
            with_it = [self.error(cosines_and_sines([*chosen, angles], load)) for angles in tried]
            if with_it and min(with_it) < CLEARLY_LESS * least:
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
        return least < MAX_REMAINING**sums * left or (
            (beside or bool(self.coupled)) and left - least > sums * _MIN_GAIN * self.spread
        )

    def _columns_of(self, terms: Sequence[Term]) -> list[Floats]:
        """Columns of these terms and of the accelerations."""
        return [self._column(term) for term in (*terms, *self.coupled)]

    def _column(self, term: Term) -> Floats:
        if term not in self._columns:
            self._columns[term] = self.column(term_values(term, part) for part in self._parts)
        return self._columns[term]
