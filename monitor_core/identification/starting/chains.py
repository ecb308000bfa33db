"""Drives of any number of masses in a row, all at the motor's speed: what a motor sees of any drive without branches.

J1 is the mass of the motor, k1 and d1 join it to J2, and so on; friction is at the motor.
"""

from __future__ import annotations

from functools import cache

from monitor_core.drive.structure import Drive, Output, Parameter, Quantity, Term
from monitor_core.kernel.tables import COULOMB, ONE, TORQUE

FRICTION = ("fm", "fc", "tau0")
"""Of the motor: viscous, Coulomb's, and a torque offset."""


@cache
def chain(masses: int, output: Output) -> Drive:
    """The drive; its states are the springs' angles, the speeds, and with the angle as output that of the motor.

    Raises:
        ValueError: no mass.
    """
    if masses < 1:
        raise ValueError(f"{masses} masses: need at least one")
    n = masses
    states = [Quantity(f"shaft{i}.phi - shaft{i + 1}.phi", "rad") for i in range(1, n)]
    states += [Quantity(f"shaft{i}.w", "rad/s") for i in range(1, n + 1)]
    terms = [*_springs(n), *_motor(n - 1)]
    if output == "angle":
        states.append(Quantity("shaft1.phi", "rad"))
        terms += [Term("A", 2 * n - 1, n - 1, 1.0, ()), Term("C", 0, 2 * n - 1, 1.0, ())]
        terms.append(Term("rest", 2 * n - 1, 0, 1.0, ()))
    else:
        terms.append(Term("C", 0, n - 1, 1.0, ()))
        terms += [Term("rest", n - 1 + i, 0, 1.0, ()) for i in range(n)]
    inputs = (TORQUE, COULOMB, ONE)
    return Drive(f"{n} masses", output, tuple(states), inputs, _parameters(n), tuple(terms), n - 1)


def names(masses: int) -> tuple[str, ...]:
    """Of inertias, springs and dampers, outwards."""
    J = [f"J{i}" for i in range(1, masses + 1)]
    return (*J, *(f"{letter}{i}" for letter in "kd" for i in range(1, masses)))


def _parameters(n: int) -> tuple[Parameter, ...]:
    J = [Parameter(f"J{i}", "kg m^2", f"inertia {i} of {n}, as the motor sees it") for i in range(1, n + 1)]
    between = [(i, f"between the inertias {i} and {i + 1}, as the motor sees it") for i in range(1, n)]
    k = [Parameter(f"k{i}", "N m/rad", f"stiffness {where}") for i, where in between]
    d = [Parameter(f"d{i}", "N m s/rad", f"damping {where}", positive=False) for i, where in between]
    fm = Parameter("fm", "N m s/rad", "viscous friction of the motor", positive=False)
    fc = Parameter("fc", "N m", "Coulomb friction of the motor", positive=False)
    return (*J, *k, *d, fm, fc, Parameter("tau0", "N m", "torque offset", positive=False))


def _springs(n: int) -> list[Term]:
    """Each stretches with the speeds of the two masses that it joins, brakes one and drives the other."""
    out = list[Term]()
    for i in range(n - 1):
        left, right = n - 1 + i, n + i
        out += [Term("A", i, left, 1.0, ()), Term("A", i, right, -1.0, ())]
        for row, mass, sign in ((left, i + 1, -1.0), (right, i + 2, 1.0)):
            J = (f"J{mass}", -1)
            out.append(Term("A", row, i, sign, (J, (f"k{i + 1}", 1))))
            out.append(Term("A", row, left, sign, (J, (f"d{i + 1}", 1))))
            out.append(Term("A", row, right, -sign, (J, (f"d{i + 1}", 1))))
    return out


def _motor(row: int) -> list[Term]:
    J = ("J1", -1)
    return [
        Term("A", row, row, -1.0, (J, ("fm", 1))),
        Term("B", row, 0, 1.0, (J,)),
        Term("B", row, 1, -1.0, (J, ("fc", 1))),
        Term("B", row, 2, 1.0, (J, ("tau0", 1))),
        Term("ratio", 1, 0, 1.0, ()),
    ]
