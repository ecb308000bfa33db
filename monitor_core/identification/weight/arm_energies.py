"""Energies of an arm whose torques may act on an axis, and these torques.

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
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, product
from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Factor, SignalProduct, Term
from monitor_core.identification.torque_balance.torque_windows import GridPart
from monitor_core.identification.weight.weight_balance import MOST_OTHERS

_MOST_OF_ANGLE = 2
"""An inertia has the squares and products of two cosines of sums, and so at most twice each angle."""
_MOST_FACTORS = 4
"""Cosines and sines in the product of a weight: of the inclination of a link, and of three axes of a wrist"""
_MOST_PARALLEL = 3
"""Parallel axes after the first one of an arm: shoulder, elbow, and the first axis of some wrists"""

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

    @property
    def of_same_sum(self) -> Energy:
        """The same for the energies that are chosen together: those with cosine and with sine of a sum."""
        return self._replace(function="")

    @property
    def exchangeable(self) -> tuple[str, ...]:
        """The angles in the sum of a weight or of an inertia, which another sum may replace.

        None of a coupling, which alone is in no arm, and none of a product, which has the same angles as the sums.
        """
        return () if self.factors or len(set(self.axes)) > 1 else tuple(angle for _, angle in self.angles)

    def function_values(self, poses: Poses, own: str) -> tuple[Floats, Floats]:
        """f and its derivative by the angle ``own`` (N,)."""
        turned = poses.turned(self.angles)
        f, slope = (turned.real, -turned.imag) if self.function == "cos" else (turned.imag, turned.real)
        for function, angles in self.factors:
            more = poses.turned(angles).real if function == "cos" else poses.turned(angles).imag
            f, slope = more * f, more * slope
        return f, self.times(own) * slope

    @property
    def followed(self) -> tuple[str, ...]:
        """The angles that it follows, those of its factors too."""
        return tuple(angle for s in (self.angles, *(s for _, s in self.factors)) for _, angle in s)

    def times(self, angle: str) -> int:
        """How often an angle is in the sum."""
        return next((n for n, name in self.angles if name == angle), 0)


class Poses:
    """Cosines and sines of sums of angles in a part of ``count`` samples.

    They are products of exp(i angle), which take less time.
    """

    def __init__(self, part: GridPart) -> None:
        self._part, self.count = part, len(part.u)
        self._none = np.ones(self.count, complex)
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


# --- Which energies may act on an axis --------------------------------------------------------------------------------


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
