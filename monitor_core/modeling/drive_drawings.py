"""Drives of the library: a motor, a gear, and masses behind it, connected by springs in a chain.

Angles behind the gear are those of the arm: r times the motor's.  Each spring is drawn so that its deflection is the
angle on the motor's side less the angle on the arm's side, as in the paper: r phi_m - phi_g, phi_g - phi_a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.modeling.drawing import Drawing, Part, part

_MOTOR = {
    "fm": "viscous friction of the motor",
    "fc": "Coulomb friction of the motor",
    "tau0": "torque offset",
    "kT": "torque constant, relative to the one the controller uses",
}
_GEAR = {"r": "gear ratio, arm angle over motor angle"}
_MASS = {"J": "inertia of motor, gear and arm, on the motor side"}
_WEIGHT = {
    "gc": "torque of the weight on the arm at the angle zero, as where the arm lies flat there",
    "gs": "torque of the weight on the arm a quarter of a turn further",
}


@dataclass(frozen=True, slots=True)
class Link:
    """A mass behind the gear, with the spring and damper that connect it to the previous one; names of parameters.

    ``mass`` and ``spring`` describe them in words; ``name`` is that of the mass in the drawing.
    """

    name: str
    mass: str
    J: str
    spring: str
    k: str
    d: str


def one_mass() -> Drawing:
    """Motor, gear and arm as one stiff mass, all on the motor side."""
    return Drawing("one-mass", _motor("J"), meanings=_MASS | _MOTOR)


def one_mass_weight() -> Drawing:
    """The same with the weight of the arm, which turns with r times the angle of the motor."""
    gear = part("ideal-gear", "gear", "motor", "gear", ratio="1/r")
    components = [*_motor("J"), gear, part("gravity", "weight", "gear", gc="gc", gs="gs")]
    return Drawing("one-mass-weight", components, meanings=_MASS | _MOTOR | _WEIGHT | _GEAR)


def two_mass() -> Drawing:
    """Motor and arm, and one spring between them."""
    return chain("two-mass", [Link("arm", "arm", "Ja", "gearbox, arm side", "k", "d")])


def three_mass() -> Drawing:
    """The drive of the paper (eq. 1-2), with Coulomb friction and torque offset."""
    gearbox = Link("gearbox", "gearbox, arm side", "Jg", "gearbox, arm side", "kg", "dg")
    return chain("three-mass", [gearbox, Link("arm", "arm", "Ja", "arm", "ka", "da")])


def five_mass() -> Drawing:
    """The accurate drive of the paper: four masses behind the gear, numbered outwards."""
    links = [
        Link(f"mass{i}", f"mass {i}, arm side", f"J{i}", f"spring {i}, arm side", f"k{i}", f"d{i}")
        for i in range(1, 5)
    ]
    return chain("five-mass", links)


def two_mass_weight() -> Drawing:
    """Motor and arm with its weight, and one spring between them."""
    return with_weight(two_mass(), "arm")


def three_mass_weight() -> Drawing:
    """The drive of the paper with the weight of the arm."""
    return with_weight(three_mass(), "arm")


def five_mass_weight() -> Drawing:
    """The accurate drive of the paper with a weight on its last mass."""
    return with_weight(five_mass(), "mass4")


def with_weight(drive: Drawing, at: str) -> Drawing:
    """The drive with a weight on this mass.

    It turns with r times the angle of the motor: what the springs give way changes it little.
    """
    weight = part("gravity", "weight", at, gc="gc", gs="gs")
    return Drawing(
        f"{drive.name}-weight", [*drive.components, weight], meanings={**drive.meanings, **_WEIGHT}
    )


def chain(name: str, links: Sequence[Link]) -> Drawing:
    """Motor and gear, and the links behind it in a chain; the motor's speed is measured."""
    meanings = {"Jm": "inertia of the motor"}
    meanings |= {link.J: f"inertia of the {link.mass}" for link in links}
    meanings |= {link.k: f"stiffness of the {link.spring}" for link in links}
    meanings |= {link.d: f"damping of the {link.spring}" for link in links}
    components = [*_motor("Jm"), part("ideal-gear", "gear", "motor", "gear", ratio="1/r")]
    before = "gear"
    for link in links:
        components.append(part("spring-damper", f"{link.name}_spring", link.name, before, c=link.k, d=link.d))
        components.append(part("inertia", link.name, link.name, J=link.J))
        before = link.name
    return Drawing(name, components, meanings=meanings | _MOTOR | _GEAR)


def _motor(J: str) -> list[Part]:
    """The motor with this inertia, its friction and its sensor."""
    return [
        part("torque", "torque", "motor", kT="kT"),
        part("inertia", "motor", "motor", J=J),
        part("viscous-friction", "bearing", "motor", d="fm"),
        part("coulomb-friction", "friction", "motor", fc="fc"),
        part("torque-offset", "offset", "motor", tau0="tau0"),
        part("speed-sensor", "encoder", "motor"),
    ]
