"""Polynomials of the cosines and sines of the angles of an arm, each angle once, and the energies that they are.

A vector that is fixed in one link has such components in the frame of another one, with whole numbers as coefficients,
where neighbouring axes are parallel or at right angles (``arm_chain``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.signal_terms import Factor, SignalProduct, Term
from monitor_core.identification.weight.arm_energies import MotionSignals, Poses

_NONE, _COS, _SIN = 0, 1, 2
_FUNCTIONS = ("", "cos", "sin")
TurningProduct = tuple[int, ...]
"""For each angle of the arm: no factor, its cosine, or its sine"""
Polynomial = Mapping[TurningProduct, int]
"""The coefficient of each monomial"""
Products = tuple[tuple[TurningProduct, int], ...]
"""A polynomial that can be compared"""
LinkVector = tuple[Polynomial, Polynomial, Polynomial]


def constant(number: int, angles: int) -> Polynomial:
    """A number as a polynomial of so many angles."""
    return {(_NONE,) * angles: number} if number else {}


def total(*addends: tuple[int, Polynomial]) -> Polynomial:
    """The sum of polynomials, each times a number."""
    found = dict[TurningProduct, int]()
    for number, polynomial in addends:
        for monomial, c in polynomial.items():
            found[monomial] = found.get(monomial, 0) + number * c
    return {monomial: c for monomial, c in found.items() if c}


def times_cosine(polynomial: Polynomial, angle: int) -> Polynomial:
    """The product with the cosine of an angle that is not in the polynomial."""
    return {(*m[:angle], _COS, *m[angle + 1 :]): c for m, c in polynomial.items()}


def times_sine(polynomial: Polynomial, angle: int) -> Polynomial:
    """The product with the sine of an angle that is not in the polynomial."""
    return {(*m[:angle], _SIN, *m[angle + 1 :]): c for m, c in polynomial.items()}


def slope(polynomial: Polynomial, angle: int) -> Polynomial:
    """The derivative by an angle."""
    turned = {_COS: (_SIN, -1), _SIN: (_COS, 1)}
    found = dict[TurningProduct, int]()
    for m, c in polynomial.items():
        if m[angle] != _NONE:
            function, sign = turned[m[angle]]
            found[*m[:angle], function, *m[angle + 1 :]] = sign * c
    return found


def product_of(first: Polynomial, second: Polynomial) -> Polynomial:
    """The product of two polynomials that have no angle in common."""
    found = dict[TurningProduct, int]()
    for m, c in first.items():
        for m_, c_ in second.items():
            both = tuple(map(sum, zip(m, m_, strict=True)))
            found[both] = found.get(both, 0) + c * c_
    return {monomial: c for monomial, c in found.items() if c}


def without_sign(polynomial: Polynomial) -> Products:
    """The same for a polynomial and its negative; empty for zero."""
    ordered = sorted(polynomial.items())
    sign = -1 if ordered and ordered[0][1] < 0 else 1
    return tuple((m, sign * c) for m, c in ordered)


def values_of(polynomial: Polynomial, cosine_or_sine: Callable[[int, int], Floats], count: int) -> Floats:
    """The polynomial (count,); ``cosine_or_sine`` gives the values of one function of one angle."""
    found = np.zeros(count)
    for monomial, c in polynomial.items():
        value = np.full(count, float(c))
        for angle, function in enumerate(monomial):
            if function != _NONE:
                value = value * cosine_or_sine(angle, function)
        found += value
    return found


class PoseEnergy(NamedTuple):
    """The energy f v_j v_k of joints ``axes`` = (j, k), as ``Energy``; f is a polynomial.

    Without ``axes``: the weight f.  ``group``: those of one group are chosen together.  ``arm``: the names of all
    angles of the arm, to which the monomials in ``products`` belong.
    """

    axes: tuple[str, ...]
    group: str
    products: Products
    arm: tuple[str, ...]
    load: str = ""

    @property
    def of_same_sum(self) -> tuple[str, ...]:
        """The same for the energies that are chosen together."""
        return (*self.axes, self.group, self.load)

    @property
    def exchangeable(self) -> tuple[str, ...]:
        """None: the arm is known, and so are the angles that it follows."""
        return ()

    @property
    def followed(self) -> tuple[str, ...]:
        """The angles that it follows."""
        return tuple(name for k, name in enumerate(self.arm) if any(m[k] != _NONE for m, _ in self.products))

    def function_values(self, poses: Poses, own: str) -> tuple[Floats, Floats]:
        """f and its derivative by the angle ``own`` (N,)."""

        def cosine_or_sine(angle: int, function: int) -> Floats:
            turned = poses.turned(((1, self.arm[angle]),))
            return turned.real if function == _COS else turned.imag

        f = dict(self.products)
        both = (values_of(p, cosine_or_sine, poses.count) for p in (f, slope(f, self.arm.index(own))))
        return next(both), next(both)

    def torque(self, own: str, signals: Mapping[str, MotionSignals]) -> Term:
        """Its torque on the axis with the angle ``own``, in terms of signals, but for a factor; as of ``Energy``."""
        return Term(tuple(self._torque(own, signals)))

    def _torque(self, own: str, signals: Mapping[str, MotionSignals]) -> Iterator[SignalProduct]:
        f = dict(self.products)
        load = (_plain(self.load),) if self.load else ()
        if not self.axes:
            yield from self._products(f, load)
            return
        j, k = self.axes
        if own not in self.axes:
            speeds = (_plain(signals[j].speed), _plain(signals[k].speed))
            yield from self._products(slope(f, self.arm.index(own)), (*load, *speeds), -1)
            return
        other = k if j == own else j
        yield from self._products(f, (*load, _plain(signals[other].acceleration)))
        for n, angle in enumerate(self.arm):
            if angle != own:
                speeds = (_plain(signals[other].speed), _plain(signals[angle].speed))
                yield from self._products(slope(f, n), (*load, *speeds))

    def _products(self, f: Polynomial, factors: tuple[Factor, ...], sign: int = 1) -> Iterator[SignalProduct]:
        for monomial, c in sorted(f.items()):
            turned = (
                Factor(_FUNCTIONS[function], ((1, self.arm[k]),))
                for k, function in enumerate(monomial)
                if function != _NONE
            )
            yield SignalProduct((*factors, *turned), float(sign * c))


def _plain(name: str) -> Factor:
    return Factor("", ((1, name),))
