"""Random drives, drawn from components, and their unreduced equations M s^2 + D s + K written from energies.

The two have nothing in common but the list of parts: this is the second way to the same transfer function.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from hypothesis import strategies as st

Angle = dict[int, Fraction]
"""A combination of the free angles, which the nodes are numbered by."""


@dataclass
class RandomDrive:
    """Tables for a drawing, and the same drive as quadratic forms."""

    parts: list[dict[str, object]] = field(default_factory=list)
    exact: dict[str, Fraction] = field(default_factory=dict)
    inertias: list[tuple[Fraction, Angle]] = field(default_factory=list)
    dampers: list[tuple[Fraction, Angle]] = field(default_factory=list)
    springs: list[tuple[Fraction, Angle]] = field(default_factory=list)
    torque: Angle = field(default_factory=dict)
    sensor: Angle = field(default_factory=dict)
    free: int = 0
    nodes: dict[str, Angle] = field(default_factory=dict)

    def node(self, angle: Angle | None = None) -> str:
        """A new node, free to turn or tied to a combination of others."""
        name = f"n{len(self.nodes)}"
        if angle is None:
            angle, self.free = {self.free: Fraction(1)}, self.free + 1
        self.nodes[name] = angle
        return name

    def add(self, kind: str, at: list[str], **roles: Fraction) -> str:
        """A component with parameters of its own, whose values are remembered."""
        name = f"c{len(self.parts)}"
        self.parts.append({"type": kind, "name": name, "at": at, **{role: f"{name}.{role}" for role in roles}})
        self.exact.update({f"{name}.{role}": value for role, value in roles.items()})
        return name

    def behind_a_gear(self, node: str, ratio: Fraction) -> str:
        """Another node: phi_node = ratio * phi_other."""
        other = self.node({i: c / ratio for i, c in self.nodes[node].items()})
        self.add("ideal-gear", [node, other], ratio=ratio)
        return other

    def join(self, kind: str, at: list[str], **roles: Fraction) -> None:
        """A spring, a damper or both between two nodes; "ground" is one.  A role that the kind lacks is ignored."""
        a, b = (self.nodes.get(node, {}) for node in at)
        stretch = minus(a, b)
        used = {role: roles[role] for role in ("c", "d") if kind != {"c": "damper", "d": "spring"}[role]}
        for role, value in used.items():
            (self.springs if role == "c" else self.dampers).append((value, stretch))
        self.add(kind, at, **used)

    def form(self, which: str) -> list[list[Fraction]]:
        """M, D or K: the sum of c a a' over the parts."""
        out = [[Fraction(0)] * self.free for _ in range(self.free)]
        for c, angle in {"M": self.inertias, "D": self.dampers, "K": self.springs}[which]:
            for i, a in angle.items():
                for j, b in angle.items():
                    out[i][j] += c * a * b
        return out

    def vector(self, angle: Angle) -> list[Fraction]:
        """A combination of angles as a column."""
        return [angle.get(i, Fraction(0)) for i in range(self.free)]


def minus(left: Angle, right: Angle) -> Angle:
    return {i: left.get(i, Fraction(0)) - right.get(i, Fraction(0)) for i in {*left, *right}}


# Within two decades, with few digits.
parameter = st.builds(Fraction, st.integers(1, 100), st.just(10))
ratio = st.builds(Fraction, st.integers(1, 9), st.integers(1, 9))


def inertia(draw: st.DrawFn, drive: RandomDrive, node: str) -> None:
    J = draw(parameter)
    drive.add("inertia", [node], J=J)
    drive.inertias.append((J, drive.nodes[node]))


def geared(draw: st.DrawFn, drive: RandomDrive, node: str) -> str:
    return drive.behind_a_gear(node, draw(ratio))


def compliance(draw: st.DrawFn, drive: RandomDrive, a: str, b: str) -> None:
    kind = draw(st.sampled_from(["spring-damper", "spring-damper", "spring", "damper"]))
    drive.join(kind, draw(st.permutations([a, b])), c=draw(parameter), d=draw(parameter))


def branch(draw: st.DrawFn, drive: RandomDrive, parent: str, massless: bool) -> str:
    """A new mass behind a gear, or not, and behind one compliance or two in series with nothing between them."""
    start = geared(draw, drive, parent) if draw(st.booleans()) else parent
    end = drive.node()
    if massless and draw(st.integers(0, 3)) == 0:
        middle = drive.node()
        compliance(draw, drive, start, middle)
        compliance(draw, drive, middle, end)
    else:
        compliance(draw, drive, start, end)
    inertia(draw, drive, end)
    if draw(st.integers(0, 3)) == 0:
        inertia(draw, drive, geared(draw, drive, end))
    return end


def ground(draw: st.DrawFn, drive: RandomDrive, node: str) -> None:
    if draw(st.booleans()):
        d = draw(parameter)
        drive.add("viscous-friction", [node], d=d)
        drive.dampers.append((d, drive.nodes[node]))
    else:
        compliance(draw, drive, node, "ground")


@st.composite
def drives(draw: st.DrawFn, most: int = 6, massless: bool = True) -> RandomDrive:
    """Chains and trees of 1 to ``most`` masses, with gears, loops, parts to ground, merged inertias."""
    drive = RandomDrive()
    masses = [drive.node()]
    inertia(draw, drive, masses[0])
    chain = draw(st.booleans())
    for _ in range(draw(st.integers(0, most - 1))):
        masses.append(branch(draw, drive, masses[-1] if chain else draw(st.sampled_from(masses)), massless))
    for node in draw(st.lists(st.sampled_from(masses), max_size=3)):
        ground(draw, drive, node)
    if len(masses) > 2 and draw(st.booleans()):
        compliance(draw, drive, *draw(st.permutations(masses))[:2])
    _instruments(draw, drive, masses)
    return drive


def _instruments(draw: st.DrawFn, drive: RandomDrive, masses: list[str]) -> None:
    at, kT = draw(st.sampled_from(masses)), draw(parameter)
    drive.add("torque", [at], kT=kT)
    drive.torque = {i: c * kT for i, c in drive.nodes[at].items()}
    seen = draw(st.sampled_from(masses))
    seen = geared(draw, drive, seen) if draw(st.booleans()) else seen
    drive.add(draw(st.sampled_from(["speed-sensor", "angle-sensor"])), [seen])
    drive.sensor = drive.nodes[seen]
