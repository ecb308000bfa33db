"""Finds how the axes of an arm follow each other, by the weight on one of them, and what may load it then.

The weight of a link is its mass times the height of its centre of gravity, so its torque on axis i has three values,
one for each component of

    d(up_k) / dq_i,      up_k: the vertical in the frame of link k

From link to link the vertical turns about the axis of the next joint.  Where neighbouring axes are parallel or at right
angles, and angles count from there, that is a direction of the frame before, whatever the lengths of the arm:

    up_k = (a cos q_k + b sin q_k, b cos q_k - a sin q_k, c),      a, b, c: the components of up_k-1 in some order

So each component is a polynomial of cosines and sines with the coefficients 1 and -1.  At the wrist of an arm with
seven axes it has eight products of up to six factors, and two or three values of the links determine all.  As products
with a value each they are more than the few points of a program determine.

There are some thousand such arms; all are tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.torque_balance.torque_windows import GridPart
from monitor_core.identification.weight.pose_polynomials import (
    LinkVector,
    Polynomial,
    PoseEnergy,
    Products,
    TurningProduct,
    constant,
    product_of,
    slope,
    times_cosine,
    times_sine,
    total,
    without_sign,
)
from monitor_core.identification.weight.weight_balance import HalfEquations, WeightBalance

MOST_AXES = 7
"""An arm of more axes is not looked for: the number of arms grows fivefold with each."""
_KEPT = 24
"""Number of arms that are continued with the next link, the best ones."""
_LEFT = 0.97
"""The weight of a further link must reduce the squared errors to this share."""
_MOST_PRODUCTS = 5
"""Most products in a coupling, whose torque has several times as many; each is computed for each sample."""


class ArmJoint(NamedTuple):
    """Which direction of the link before is the axis of a joint, and whether it is turned in the opposite sense."""

    direction: int
    opposite: bool

    def seen_from_next(self, vector: LinkVector, angle: int) -> LinkVector:
        """A vector in the frame of the link before, in that of the link after the joint."""
        a, b = (vector[k] for k in range(3) if k != self.direction)
        sign = -1 if self.opposite else 1
        return (
            total((1, times_cosine(a, angle)), (sign, times_sine(b, angle))),
            total((1, times_cosine(b, angle)), (-sign, times_sine(a, angle))),
            vector[self.direction],
        )

    def seen_from_before(self, vector: LinkVector, angle: int) -> LinkVector:
        """The reverse of ``seen_from_next``."""
        x, y, z = vector
        sign = -1 if self.opposite else 1
        a = total((1, times_cosine(x, angle)), (-sign, times_sine(y, angle)))
        b = total((1, times_cosine(y, angle)), (sign, times_sine(x, angle)))
        others = iter((a, b))
        first, second, third = (z if k == self.direction else next(others) for k in range(3))
        return first, second, third


_JOINTS = tuple(ArmJoint(direction, opposite) for direction, opposite in product(range(3), (False, True)))


class ArmChain(NamedTuple):
    """The joints of an arm from the base on, and the weights of its links on an axis."""

    joints: tuple[ArmJoint, ...]
    vertical: LinkVector
    """in the frame of the last link"""
    weights: tuple[tuple[Products, ...], ...]
    """of each link that is found to load the axis"""
    error: float
    """sum of the squared errors of each half of the equations with values from the other half"""


def arm_chain(balance: ChainBalance) -> ArmChain | None:
    """The arm that explains the weight on an axis best; None: no link loads it."""
    count = len(balance.arm)
    none = constant(0, count)
    chains = [ArmChain((), (none, none, constant(1, count)), (), balance.error(()))]
    for place in range(count):
        further = dict[object, ArmChain]()
        for chain in chains:
            for joint in _JOINTS:
                vertical = joint.seen_from_next(chain.vertical, place)
                # Links are continued alike if their frames differ by the names or the signs of their directions only.
                alike = (tuple(sorted(map(without_sign, vertical))), chain.weights)
                further.setdefault(alike, chain._replace(joints=(*chain.joints, joint), vertical=vertical))
        chains = list(further.values())
        if place >= balance.place:
            chains = sorted(map(balance.loaded, chains), key=lambda chain: chain.error)[:_KEPT]
    return chains[0] if chains[0].weights else None


class ChainBalance(WeightBalance):
    """The torque balance with weights of an arm, as normal equations of each half of the windows.

    All products of cosines and sines have a column, so that thousands of arms are tried in seconds.

    Args:
        parts: pieces of the records of an axis with these angles as signals [rad].
        window: length of the windows, in samples.
        scale: speed scale of Coulomb friction, rad/s.
        own: name of the angle of the axis itself.
        arm: names of all angles of the arm, from the base to the hand, at most MOST_AXES.
        accelerations: names of signals that may load the axis, too.
    """

    def __init__(
        self,
        parts: Sequence[GridPart],
        window: int,
        scale: float,
        own: str,
        arm: Sequence[str],
        accelerations: Sequence[str] = (),
    ) -> None:
        super().__init__(parts, window, scale)
        self.arm, self.place, self._own = tuple(arm), list(arm).index(own), own
        beside = [self.column(part.signals[name] for part in parts) for name in accelerations]
        ones = [np.ones(len(part.u)) for part in parts]
        turned = [[(np.cos(part.signals[name]), np.sin(part.signals[name])) for part in parts] for name in arm]
        known = dict(self._products((), ones, turned))
        rows = np.column_stack([self.rows, *beside, *known.values()])
        self._usual = np.arange(self.rows.shape[1] + len(beside))
        self._at = {monomial: len(self._usual) + k for k, monomial in enumerate(known)}
        self._normal, self._size = self.normal_equations(rows)

    def _products(
        self, begun: TurningProduct, values: Sequence[Floats], turned: Sequence[Sequence[tuple[Floats, Floats]]]
    ) -> Iterator[tuple[TurningProduct, Floats]]:
        """The columns of all monomials with the own angle that begin so, with these values in each part."""
        place = len(begun)
        if place == len(turned):
            yield begun, self.column(values)
            return
        if place != self.place:
            yield from self._products((*begun, 0), values, turned)
        for k in range(2):
            further = [value * both[k] for value, both in zip(values, turned[place], strict=True)]
            yield from self._products((*begun, k + 1), further, turned)

    def error(self, weights: Sequence[Sequence[Products]]) -> float:
        """Sum of squared errors of each half of the equations with values that were fitted to the other half."""
        chosen = [products for link in weights for products in link]
        monomials = dict.fromkeys(self._at[m] for products in chosen for m, _ in products)
        used: Ints = np.array([*self._usual, *monomials], np.int64)
        place = {column: k for k, column in enumerate(used.tolist())}
        C = np.zeros((len(used), len(self._usual) + len(chosen)))
        C[self._usual, self._usual] = 1.0
        for k, products in enumerate(chosen):
            for monomial, c in products:
                column = self._at[monomial]
                C[place[column], len(self._usual) + k] = c * self._size[column]
        C /= np.sqrt((C**2).sum(axis=0))
        square = np.ix_(used, used)
        first, last = (HalfEquations(C.T @ G[square] @ C, b[used] @ C, yy) for G, b, yy in self._normal)
        return last.missed_with(first) + first.missed_with(last)

    def loaded(self, chain: ArmChain) -> ArmChain:
        """The chain with the weight of its last link, if that reduces the error."""
        turned = (without_sign(slope(component, self.place)) for component in chain.vertical)
        weights = (*chain.weights, tuple(products for products in turned if products))
        error = self.error(weights) if weights[-1] else chain.error
        return chain._replace(weights=weights, error=error) if error < _LEFT * chain.error else chain

    def energies(self, chain: ArmChain, load: str = "") -> tuple[PoseEnergy, ...]:
        """The weights of its links, and the couplings to the motion of other axes; ``load``: as of ``Energy``."""
        found = [
            PoseEnergy((), f"link {number}", products, self.arm, load)
            for number, link in enumerate(chain.weights)
            for products in link
        ]
        return (*found, *self._couplings(chain, load))

    def _couplings(self, chain: ArmChain, load: str) -> Iterator[PoseEnergy]:
        for place, name in enumerate(self.arm[: len(chain.joints)]):
            if place == self.place:
                continue
            first, last = sorted((place, self.place))
            found = dict.fromkeys(map(without_sign, couplings(chain.joints, first, last)))
            for number, products in enumerate(products for products in found if products):
                energy = PoseEnergy((self._own, name), f"coupling {number}", products, self.arm, load)
                if len(products) <= _MOST_PRODUCTS:
                    yield energy


def couplings(joints: Sequence[ArmJoint], first: int, last: int) -> Iterator[Polynomial]:
    """What couples the speeds of two joints, by their places: polynomials of the angles between and beyond them.

    A vector u in a link from ``first`` on and a vector w in one from ``last`` on move with both.  A mass at their end
    has the energy (z_first x u) (z_last x w) v_first v_last, with the axes z of the joints.
    """
    count = len(joints)
    unity, none = constant(1, count), constant(0, count)
    unit: tuple[LinkVector, ...] = ((unity, none, none), (none, unity, none), (none, none, unity))
    for link in range(last, count):
        for end in unit:
            arm = end
            for place in range(link, last, -1):
                arm = joints[place].seen_from_before(arm, place)
            x, y, _ = arm
            moved: LinkVector = (total((-1, y)), x, none)  # z_last x w
            for between in range(last - 1, first - 1, -1):
                moved = joints[between + 1].seen_from_before(moved, between + 1)
                axis = unit[2]
                for place in range(first + 1, between + 1):
                    axis = joints[place].seen_from_next(axis, place)
                for m in range(3):
                    a, b = (m + 1) % 3, (m + 2) % 3  # z_first x u for the unit vector m
                    yield total((1, product_of(axis[b], moved[a])), (-1, product_of(axis[a], moved[b])))
    axis = unit[2]
    for place in range(first + 1, last + 1):
        axis = joints[place].seen_from_next(axis, place)
    yield from axis  # the inertia of the last link itself
