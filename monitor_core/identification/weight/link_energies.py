"""Finds the energies of an arm whose torques act on an axis, above all those of its inertia, which follow the pose.

The kinetic energy of a serial arm is a sum of terms E = m f(s) v_j v_k with the speeds v of two joints, or of one, and
f the cosine or sine of a sum s of joint angles.  By Lagrange's equation such a term loads axis i with the torque

    d/dt (dE / dv_i) - dE / dq_i

For j = k = i it is the inertia of the axis itself, which follows the pose of the axes beyond it: the inertia of a
robot's base changes several times as the arm stretches.  For j = k = another axis it is a centrifugal torque, and for
i = j the coupling to the acceleration of axis k.  Each term has one value, m, to be fitted.  No derivative is measured
for that: the equations are integrated by parts (torque_windows.py).

Weights are candidates, too: where links move fast, only these torques together show them.  The axes of a wrist are at
right angles to each other, so the weight on them is a product of cosines and sines of single angles, each of which is a
sum of up to eight cosines and sines of sums.  So with many axes these products are candidates as they are.

A load that is carried for a part of the time, as by a gripper, adds the same energies times its measured mass m(t), or
times a signal that is 0 or 1.  It changes where the arm stands, so the same equations hold:

    d/dt (m dE / dv_i) - m dE / dq_i

Terms are chosen one by one by cross-validation: the values are fitted to one half of the data, and the error is that of
the other half, and vice versa.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, product
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats, Ints
from monitor_core.drive.signal_terms import Factor, SignalProduct, Term
from monitor_core.identification.torque_balance.torque_windows import WINDOWS, GridPart
from monitor_core.identification.weight.weight_balance import MIN_INCREASE, MOST_OTHERS, WeightBalance

_MOST_SUMS = 16
_MOST_OF_ANGLE = 2
"""An inertia has the squares and products of two cosines of sums, and so at most twice each angle."""
_MOST_FACTORS = 4
"""Cosines and sines in the product of a weight: of the inclination of a link, and of three axes of a wrist"""
_MOST_PARALLEL = 3
"""Parallel axes after the first one of an arm: shoulder, elbow, and the first axis of some wrists"""
_MAX_REMAINING = 0.95
"""A further sum must reduce the squared errors to at most this share, .."""
_BY_CHANCE = 6.0
""".. and by more than the best of so many sums does by chance: a chi-square of 2 ln(number), thrice that as errors
are alike for some windows."""
_CLEARLY_LESS = 0.95
"""A sum that was chosen before a later one is exchanged if another one leaves at most this share of the errors."""
_DETERMINED = 1e-10
"""Singular values of the normal equations below this share of the largest are left out."""
_WELL_DETERMINED = 1e-6
"""Further energies are well determined if beside the others this share of their squares is left."""

AngleSum = tuple[tuple[int, str], ...]
"""A sum of angles, by the names of their signals, each with a whole factor; of a weight that is its sign"""


class MotionSignals(NamedTuple):
    """Names of the signals that are the speed and the acceleration of an angle."""

    speed: str
    acceleration: str


class Energy(NamedTuple):
    """The energy f(s) v_j v_k of joints ``axes`` = (j, k); f is ``function``, s is ``angles``.

    Without ``axes``: the weight f(s), which is the derivative of a potential energy; without angles it follows no pose,
    as that on a linear axis.
    ``load``: the name of the signal of a carried load by which it is multiplied; "": none.
    ``factors``: of a weight, further functions of sums of other angles by which it is multiplied.
    """

    axes: tuple[str, ...]
    function: str
    angles: AngleSum
    load: str = ""
    factors: tuple[tuple[str, AngleSum], ...] = ()

    def torque(self, own: str, signals: Mapping[str, MotionSignals]) -> Term:
        """Its torque on the axis with the angle ``own``, in terms of signals, but for a factor.

        With n_i the number of times that the angle i is in s, and a the accelerations:

            f(s)                                            of a weight
            -n_own f'(s) v_j v_k                            of the speeds of other axes
            f(s) a_k + f'(s) v_k sum of n_i v_i, i != own   of the own speed and that of k: what has n_own cancels
        """
        load = (_signal(self.load),) if self.load else ()
        if not self.axes and not self.angles:
            return Term.product(*load)
        f = _factor(self.function, self.angles)
        if not self.axes:
            return Term.product(*load, f, *(_factor(function, angles) for function, angles in self.factors))
        slope = Factor("sin" if self.function == "cos" else "cos", f.addends)
        sign = -1 if self.function == "cos" else 1
        j, k = self.axes
        if own not in self.axes:
            number = -sign * float(np.sign(self.times(own)))
            speeds = (Factor("square", ((1, signals[j].speed),)),) if j == k else _speeds(signals, j, k)
            return Term((SignalProduct((*load, *speeds, slope), number),))
        other = k if j == own else j
        accelerating = (*load, _signal(signals[other].acceleration), *((f,) if self.angles else ()))
        turning = (
            SignalProduct((*load, *_speeds(signals, other, angle), slope), float(sign * n))
            for n, angle in self.angles
            if angle != own
        )
        return Term((SignalProduct(accelerating), *turning))

    def function_values(self, poses: Poses) -> tuple[Floats, Floats]:
        """f and its derivative by s (N,)."""
        turned = poses.turned(self.angles)
        f, slope = (turned.real, -turned.imag) if self.function == "cos" else (turned.imag, turned.real)
        for function, angles in self.factors:
            more = poses.turned(angles).real if function == "cos" else poses.turned(angles).imag
            f, slope = more * f, more * slope
        return f, slope

    @property
    def followed(self) -> tuple[str, ...]:
        """The angles that it follows, those of its factors too."""
        return tuple(angle for s in (self.angles, *(s for _, s in self.factors)) for _, angle in s)

    def times(self, angle: str) -> int:
        """How often an angle is in the sum."""
        return next((n for n, name in self.angles if name == angle), 0)


class Poses:
    """Cosines and sines of sums of angles in a part, as products of exp(i angle), which take less time."""

    def __init__(self, part: GridPart) -> None:
        self._part, self._none = part, np.ones(len(part.u), complex)
        self._turned: dict[tuple[int, str], NDArray[np.complex128]] = {}

    def turned(self, angles: AngleSum) -> NDArray[np.complex128]:
        """exp(i s) (N,) of a sum s of angles."""
        return prod((self._multiple(*angle) for angle in angles), start=self._none)

    def _multiple(self, n: int, angle: str) -> NDArray[np.complex128]:
        if (n, angle) not in self._turned:
            self._turned[n, angle] = np.exp(1j * n * self._part.signals[angle])
        return self._turned[n, angle]


def _factor(function: str, angles: AngleSum) -> Factor:
    return Factor(function, tuple((int(np.sign(n)), a) for n, a in angles for _ in range(abs(n))))


def _signal(name: str) -> Factor:
    return Factor("", ((1, name),))


def _speeds(signals: Mapping[str, MotionSignals], *angles: str) -> tuple[Factor, ...]:
    return tuple(_signal(signals[angle].speed) for angle in angles)


class LinkEnergies(NamedTuple):
    """Energies whose torque acts on an axis, and how well all terms explain it."""

    found: tuple[Energy, ...]
    explained: float
    """share of the torque that is explained in each half of the records, with values of the other half"""
    before: float
    """the same without these energies"""
    needless: tuple[int, ...]
    """indices of the given terms that explain nothing in addition to these energies"""
    undetermined: tuple[str, ...]
    """further angles that these energies may follow as well: the records do not tell"""


def link_energies(balance: EnergyBalance) -> LinkEnergies:
    """The energies of links whose torque acts on the axis of this balance.

    Sums are added one by one as long as the next one reduces the error, and exchanged if another one is better together
    with a later one.  Then single cosines and sines, and given terms, are left out if they explain nothing.
    """
    before = balance.error(())
    sums, left = list[int](), before
    while len(sums) < _MOST_SUMS:
        best, least = balance.best(sums)
        if not least < balance.max_remaining * left:
            break
        sums, left = [*sums, best], least
        for place in range(len(sums) - 1):
            others = [*sums[:place], *sums[place + 1 :]]
            best, least = balance.best(others)
            if least < _CLEARLY_LESS * left:
                sums, left = [*others, best], least
    chosen = [index for number in sums for index in balance.same_sum[number]]
    for index in tuple(chosen):
        fewer = [other for other in chosen if other != index]
        if balance.error(fewer) < MIN_INCREASE * left:
            chosen = fewer
    needless = list[int]()
    for index in range(balance.given if chosen else 0):
        if balance.error(chosen, (*needless, index)) < MIN_INCREASE * left:
            needless.append(index)
    found = tuple(balance.energies[index] for index in chosen)
    return LinkEnergies(
        found,
        balance.share_explained(balance.error(chosen)),
        balance.share_explained(before),
        tuple(needless),
        _undetermined(balance, sums, left, {angle for energy in found for angle in energy.followed}),
    )


def _undetermined(balance: EnergyBalance, sums: Sequence[int], left: float, used: Collection[str]) -> tuple[str, ...]:
    """The angles that are not used, but are in a sum that explains about as much as a chosen one.

    ``left``: the error with the chosen ``sums``.  They are exchanged for weights and inertias only: a coupling alone is
    in no arm.  Products have the same angles as the sums.
    """
    found = dict[str, None]()
    for place, energies in enumerate(balance.same_sum):
        energy = balance.energies[energies[0]]
        new = [angle for _, angle in energy.angles if angle not in used and angle not in found]
        if not new or energy.factors or len(set(energy.axes)) > 1:
            continue
        exchanged = min(
            (balance.sums_error([place, *(s for s in sums if s != other)]) for other in sums), default=np.inf
        )
        if _CLEARLY_LESS * exchanged < left:
            found.update(dict.fromkeys(new))
    return tuple(found)


class EnergyBalance(WeightBalance):
    """The torque balance with these energies, as normal equations of each half of the windows.

    With many candidates, and few of them chosen, these are solved much faster than the windows.

    Args:
        parts: pieces of the records of an axis with these angles as signals [rad].
        window: length of the windows, in samples.
        scale: speed scale of Coulomb friction, rad/s.
        own: name of the angle of the axis itself.
        energies: those that may act on the axis (``possible_energies``).
        terms: values (N,) of further terms of the torque in all parts, one after the other.
    """

    def __init__(
        self,
        parts: Sequence[GridPart],
        window: int,
        scale: float,
        own: str,
        energies: Sequence[Energy],
        terms: Sequence[Floats],
    ) -> None:
        super().__init__(parts, window, scale)
        ends = np.cumsum([len(part.u) for part in parts])[:-1]
        further = [self.column(np.split(values, ends)) for values in terms]
        self.energies = energies
        poses = [Poses(part) for part in parts]
        columns = [self._energy_column(energy, own, poses) for energy in self.energies]
        rows = np.column_stack([self.rows, *further, *columns])
        size = np.sqrt((rows**2).sum(axis=0))
        rows = rows / np.where(size > 0, size, 1.0)
        self.given = len(further)
        """Number of further terms"""
        self._usual = self.rows.shape[1] + self.given
        halves = ((rows[half], self.torque[half]) for half in self.halves)
        self._normal = [(X.T @ X, X.T @ y, float(y @ y)) for X, y in halves]
        by_sum = dict[Energy, list[int]]()
        for index, energy in enumerate(self.energies):
            by_sum.setdefault(energy._replace(function=""), []).append(index)
        self.same_sum = list(by_sum.values())
        """Of each sum, the indices of its energies of the same joints: with cosine and with sine"""
        self._alike = [
            (np.array(places), self._usual + np.array([self.same_sum[place] for place in places]))
            for places in _by_length(self.same_sum)
        ]
        """Places of ``same_sum`` with the same number of energies, and the columns of these"""
        independent = max(len(self.torque) / WINDOWS, 1.0)
        self.max_remaining = min(_MAX_REMAINING, 1 - _BY_CHANCE * np.log(len(by_sum)) / independent)
        """A further sum must reduce the squared errors to at most this share"""

    def best(self, chosen: Sequence[int]) -> tuple[int, float]:
        """The place in ``same_sum`` of what explains most in addition to these places, and the error with it.

        None is preferred for its few angles: the inertia of a base follows the squares of cosines, and with the cosines
        the torque in other poses would be off by half as much again.
        """
        errors = self._errors_beside([index for place in chosen for index in self.same_sum[place]])
        errors[list(chosen)] = np.inf
        for place in np.flatnonzero(np.isnan(errors)).tolist():
            errors[place] = self.sums_error([*chosen, place])
        best = int(np.argmin(errors))
        return best, self.sums_error([*chosen, best])

    def _errors_beside(self, chosen: Sequence[int]) -> Floats:
        """The errors with these energies and those of each place of ``same_sum``, by block elimination.

        NaN where the energies of a place are hardly determined beside the others.
        """
        used = np.concatenate([np.arange(self._usual), self._usual + np.array(chosen, np.int64)])
        missed = np.zeros(len(self.same_sum))
        for (G, b, _), (G_, b_, yy) in (self._normal, self._normal[::-1]):
            base = np.linalg.lstsq(G[np.ix_(used, used)], np.column_stack([b, G])[used], rcond=_DETERMINED)[0]
            for places, columns in self._alike:
                X = base[:, 1 + columns].transpose(1, 0, 2)  # (places, used, energies of a place)
                own = columns[:, :, np.newaxis], columns[:, np.newaxis]
                beside = G[columns][:, :, used]  # (places, energies of a place, used)
                left = G[own] - beside @ X
                determined = np.linalg.eigvalsh(left)[:, 0] > _WELL_DETERMINED * G[columns, columns].max(axis=1)
                left[~determined] = np.eye(columns.shape[1])
                found = np.linalg.solve(left, (b[columns] - beside @ base[:, 0])[..., np.newaxis])[..., 0]
                others = base[:, 0] - (X @ found[..., np.newaxis])[..., 0]  # (places, used)
                values = np.concatenate([others, found], axis=1)
                which = np.concatenate([np.tile(used, (len(places), 1)), columns], axis=1)
                square = G_[which[:, :, np.newaxis], which[:, np.newaxis]]
                explained = ((2 * b_[which] - (square @ values[..., np.newaxis])[..., 0]) * values).sum(axis=1)
                missed[places] += np.where(determined, yy - explained, np.nan)
        return missed

    def sums_error(self, places: Sequence[int]) -> float:
        """The error with the energies at these places of ``same_sum``."""
        return self.error([index for place in places for index in self.same_sum[place]])

    def error(self, chosen: Sequence[int], without: Sequence[int] = ()) -> float:
        """Sum of squared errors of each half of the equations with values that were fitted to the other half.

        ``chosen``: energies; ``without``: given terms that are left out.
        """
        usual = np.delete(np.arange(self._usual), self.rows.shape[1] + np.array(without, np.int64))
        used: Ints = np.concatenate([usual, self._usual + np.array(chosen, np.int64)])
        square = np.ix_(used, used)
        missed = 0.0
        for (G, b, _), (G_, b_, yy) in (self._normal, self._normal[::-1]):
            found = np.linalg.lstsq(G[square], b[used], rcond=_DETERMINED)[0]
            missed += yy - float(2 * found @ b_[used] - found @ G_[square] @ found)
        return missed

    def _energy_column(self, energy: Energy, own: str, poses: Sequence[Poses]) -> Floats:
        """The integrals (M,) of the torque of this energy."""
        carried = [part.signals[energy.load] if energy.load else np.ones(len(part.u)) for part in self._parts]
        if not energy.axes:
            return self.column(
                mass * energy.function_values(pose)[0] for mass, pose in zip(carried, poses, strict=True)
            )
        j, k = energy.axes
        n = energy.times(own)
        rates, torques = list[Floats](), list[Floats]()
        for mass, part, pose in zip(carried, self._parts, poses, strict=True):
            v = {angle: np.gradient(part.signals[angle], part.h) for angle in (j, k)}
            f, slope = energy.function_values(pose)
            momentum = f * v[k if j == own else j] if own in energy.axes else np.zeros(len(part.u))
            rates.append(mass * momentum)
            torques.append(-n * mass * slope * v[j] * v[k])
        return self.rate(rates) + self.column(torques)


def _by_length(lists: Sequence[Sequence[int]]) -> list[list[int]]:
    """Indices of lists, together where these are of the same length."""
    found = dict[int, list[int]]()
    for k, entries in enumerate(lists):
        found.setdefault(len(entries), []).append(k)
    return list(found.values())


def possible_energies(
    own: str, angles: Sequence[str], beside: Sequence[str] = (), load: str = ""
) -> tuple[Energy, ...]:
    """Energies that may act on an axis, those with cosine and sine of the same sum one after the other.

    Args:
        own: name of the angle of the axis itself.
        angles: names of all angles, own too, that do not wrap, from the base to the hand.
        beside: names of the angles of other axes that do not turn the arm, as linear ones, to whose acceleration the
            axis may be coupled.
        load: name of the signal of a carried load, by which each energy may be multiplied; "": none.
    """
    alone = tuple(_of_arm(own, angles, beside))
    if not load:
        return alone
    # A linear axis bears a load whatever the pose; so does an axis whose motor also moves that one.
    every = (Energy((own, own), "cos", ()), *alone, Energy((), "cos", ()))
    return (*alone, *(energy._replace(load=load) for energy in every))


def _of_arm(own: str, angles: Sequence[str], beside: Sequence[str]) -> Iterator[Energy]:
    """Those of the arm alone; arguments as of ``possible_energies``."""
    yield from _waves((), (s for s in _sums(angles, 1 + MOST_OTHERS, 1) if _has(s, own)))
    if _has_many(angles):
        yield from _weight_products(own, angles[1:])
    for place, axis in enumerate(angles):
        # What an axis turns depends on the angles beyond it, and loads only the axes that change it.
        beyond = _sums(angles[place + 1 :], 2)
        yield from _waves((axis, axis), (s for s in beyond if axis == own or _has(s, own)))
        if axis != own:
            yield from _couplings(own, axis, angles)
    # A spindle that turns and lifts has one load for two motors.
    yield from (Energy((own, axis), "cos", ()) for axis in beside)


def _couplings(own: str, axis: str, angles: Sequence[str]) -> Iterator[Energy]:
    """Those of the speeds of two axes of the arm."""
    both = tuple(angle for angle in angles if angle in (own, axis))
    yield Energy((own, axis), "cos", ())
    # Of two links in a plane: l1 l2 cos(q2), each angle once.  In a parallelogram linkage both angles are those to the
    # ground, so the nearer one matters, too.
    yield from _waves((own, axis), _sums(angles[angles.index(both[0]) :], 1, 1))
    yield from _waves((own, axis), (s for s in _sums(both, 2, 1) if len(s) > 1))
    if _has_many(angles) and angles[0] in both:
        # The base turns what is beyond a link as that is inclined, by two or three parallel axes.
        for end in range(3, _MOST_PARALLEL + 2):
            yield from _waves((own, axis), _inclinations(angles[1:end]))


def _waves(axes: tuple[str, ...], sums: Iterable[AngleSum]) -> Iterator[Energy]:
    """With cosine and sine of each sum."""
    yield from (Energy(axes, f, s) for s in sums for f in ("cos", "sin"))


def _has(angles: AngleSum, own: str) -> bool:
    return any(own == angle for _, angle in angles)


def _has_many(angles: Sequence[str]) -> bool:
    """Whether the arm has a wrist, on which weights are products."""
    return len(angles) > 1 + MOST_OTHERS


def _weight_products(own: str, angles: Sequence[str]) -> Iterator[Energy]:
    """Weights on the axis ``own`` that are products of cosines and sines: of a link's inclination, of angles beyond.

    ``angles``: those beyond the first axis of the arm, which is vertical as a rule: no weight follows its angle.
    """
    found = dict.fromkeys(
        sums
        for parallel in range(1, _MOST_PARALLEL + 1)
        for link in _inclinations(angles[:parallel])
        for count in range(1, _MOST_FACTORS)
        for beyond in combinations([((1, angle),) for angle in angles[parallel:]], count)
        for sums in ((link, *beyond), beyond)
        if len(sums) > 1 and any(_has(s, own) for s in sums)
    )
    for sums in found:
        first, *others = sorted(sums, key=lambda s: not _has(s, own))
        for functions in product(("cos", "sin"), repeat=len(others)):
            factors = tuple(zip(functions, others, strict=True))
            yield from (Energy((), f, first, factors=factors) for f in ("cos", "sin"))


def _inclinations(angles: Sequence[str]) -> Iterator[AngleSum]:
    """The inclination of the last of links with parallel axes, whose angles may be counted in either sense."""
    for signs in product((1, -1), repeat=len(angles) - 1):
        yield tuple(zip((1, *signs), angles, strict=True))


def _sums(angles: Sequence[str], most: int, most_times: int = _MOST_OF_ANGLE) -> Iterator[AngleSum]:
    """Sums of up to so many angles, each so many times at most, with a plus sign for the first one."""
    for count in range(1, most + 1):
        for names in combinations(angles, count):
            upwards = range(1, most_times + 1)
            either = [*(-n for n in upwards), *upwards]
            for factors in product(upwards, *[either] * (count - 1)):
                yield tuple(zip(factors, names, strict=True))
