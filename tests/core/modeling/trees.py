"""Random drives, and their equations of motion M phi'' + D phi' + K phi = b kT u written down a second time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from hypothesis import strategies as st

from monitor_core.modeling.drawing import (
    AngleSensor,
    Damper,
    Drawing,
    IdealGear,
    Inertia,
    Part,
    SpeedSensor,
    Spring,
    SpringDamper,
    Torque,
    ViscousFriction,
)

PRIME = 2**61 - 1
"""Numbers here are integers modulo this: exact, and as quick as floating point."""


@dataclass(frozen=True)
class Link:
    """What joins a mass to its parent (-1: ground): spring, damper, as one component or two, perhaps a gear."""

    parent: int
    spring: bool
    damper: bool
    as_one: bool
    geared: bool


@dataclass(frozen=True)
class Tree:
    """Masses with their links; the torque acts on one of them, the sensor is at another."""

    links: tuple[Link, ...]
    friction: tuple[bool, ...]
    long: tuple[bool, ...]
    torque: int
    sensor: int
    quantity: str

    def drawing(self) -> Drawing:
        parts: list[Part] = [Torque("torque", f"in{self.torque}", kT="kT")]
        for i, link in enumerate(self.links):
            parts += self._mass(i)
            parts += self._link(i, link)
        sensor = SpeedSensor if self.quantity == "speed" else AngleSensor
        return Drawing("tree", [*parts, sensor("encoder", f"in{self.sensor}")])

    def _mass(self, i: int) -> list[Part]:
        """A long mass has a node at each end."""
        nodes = (f"in{i}", f"out{i}") if self.long[i] else (f"in{i}",)
        friction = [ViscousFriction(f"bearing{i}", nodes[-1], d=f"f{i}")] if self.friction[i] else []
        return [Inertia(f"mass{i}", *nodes, J=f"J{i}"), *friction]

    def _link(self, i: int, link: Link) -> list[Part]:
        before = "ground" if link.parent < 0 else f"{'out' if self.long[link.parent] else 'in'}{link.parent}"
        parts: list[Part] = []
        if link.geared:
            parts.append(IdealGear(f"gear{i}", before, f"behind{i}", ratio=f"1/r{i}"))
            before = f"behind{i}"
        if link.spring and link.damper and link.as_one:
            return [*parts, SpringDamper(f"link{i}", before, f"in{i}", c=f"k{i}", d=f"d{i}")]
        if link.spring:
            parts.append(Spring(f"spring{i}", before, f"in{i}", c=f"k{i}"))
        if link.damper:
            parts.append(Damper(f"damper{i}", before, f"in{i}", d=f"d{i}"))
        return parts

    def stiffness(self, values: Mapping[str, int], s: int) -> list[list[int]]:
        """M s^2 + D s + K, modulo PRIME."""
        n = len(self.links)
        Z = [[0] * n for _ in range(n)]
        for i, link in enumerate(self.links):
            Z[i][i] += values[f"J{i}"] * s * s + (values[f"f{i}"] * s if self.friction[i] else 0)
            z = (values[f"k{i}"] if link.spring else 0) + (values[f"d{i}"] * s if link.damper else 0)
            ratio = values[f"r{i}"] if link.geared else 1
            deflection = {i: 1} if link.parent < 0 else {i: 1, link.parent: -ratio}
            for a, x in deflection.items():
                for b, y in deflection.items():
                    Z[a][b] += z * x * y
        return Z

    def response(self, values: Mapping[str, int], s: int) -> int:
        """Angle at the sensor over torque, at s, modulo PRIME."""
        b = [values["kT"] if i == self.torque else 0 for i in range(len(self.links))]
        return solve(self.stiffness(values, s), b)[self.sensor]


def solve(A: list[list[int]], b: list[int]) -> list[int]:
    """Gauss, modulo PRIME.

    Raises:
        ZeroDivisionError: the matrix is singular.
    """
    rows = [{j: x % PRIME for j, x in enumerate([*row, y]) if x % PRIME} for row, y in zip(A, b, strict=True)]
    n, done = len(rows), list[dict[int, int]]()
    for j in range(n):
        candidates = [row for row in rows if j in row]
        if not candidates:
            raise ZeroDivisionError
        pivot = min(candidates, key=len)
        inverse = pow(pivot[j], -1, PRIME)
        pivot_row = {k: x * inverse % PRIME for k, x in pivot.items()}
        rows = [_minus(row, row.get(j, 0), pivot_row) for row in rows if row is not pivot]
        done = [_minus(row, row.get(j, 0), pivot_row) for row in done]
        done.append(pivot_row)
    return [row.get(n, 0) for row in done]


def _minus(row: dict[int, int], factor: int, pivot: dict[int, int]) -> dict[int, int]:
    if not factor:
        return row
    out = dict(row)
    for k, x in pivot.items():
        out[k] = (out.get(k, 0) - factor * x) % PRIME
    return {k: x for k, x in out.items() if x}


def modulo(value: Fraction) -> int:
    return value.numerator * pow(value.denominator, -1, PRIME) % PRIME


@st.composite
def trees(draw: st.DrawFn, most: int = 6, grounded: bool = True) -> Tree:
    """A root (on ground, or free), and masses that hang on an earlier one by a spring, a damper or both."""
    n = draw(st.integers(1, most))
    held = grounded and draw(st.booleans())
    links = [Link(-1, held, held, True, False)]
    for i in range(1, n):
        spring, damper = draw(st.sampled_from([(True, True), (True, False), (False, True)]))
        parent = draw(st.integers(-1 if grounded else 0, i - 1))
        links.append(Link(parent, spring, damper, draw(st.booleans()), draw(st.booleans()) and parent >= 0))
    booleans = st.lists(st.booleans(), min_size=n, max_size=n).map(tuple)
    mass = st.integers(0, n - 1)
    quantity = st.sampled_from(["speed", "angle"])
    return Tree(tuple(links), draw(booleans), draw(booleans), draw(mass), draw(mass), draw(quantity))
