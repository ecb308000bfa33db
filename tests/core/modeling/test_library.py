"""The drives that come with the program: their names, and the paper's three-mass drive entry by entry."""

from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.standard_drives import DRAWINGS
from monitor_core.modeling.statespace import Entries
from tests.core.modeling.expressions import parse

THREE_MASSES = DRAWINGS["three-mass"]


def test_the_parameters_of_the_three_masses_in_words() -> None:
    assert [(p.name, p.unit, p.meaning, p.positive, p.value) for p in THREE_MASSES.flat().parameters] == [
        ("Jm", "kg m^2", "inertia of the motor", True, None),
        ("Jg", "kg m^2", "inertia of the gearbox, arm side", True, None),
        ("Ja", "kg m^2", "inertia of the arm", True, None),
        ("kg", "N m/rad", "stiffness of the gearbox, arm side", True, None),
        ("ka", "N m/rad", "stiffness of the arm", True, None),
        ("dg", "N m s/rad", "damping of the gearbox, arm side", False, None),
        ("da", "N m s/rad", "damping of the arm", False, None),
        ("fm", "N m s/rad", "viscous friction of the motor", False, None),
        ("fc", "N m", "Coulomb friction of the motor", False, None),
        ("tau0", "N m", "torque offset", False, None),
        ("kT", "1", "torque constant, relative to the one the controller uses", True, None),
        ("r", "1", "gear ratio, arm angle over motor angle", True, None),
    ]


A = """
    0         0        r                 -1              0
    0         0        0                  1             -1
    -kg*r/Jm  0        -(fm+dg*r^2)/Jm    dg*r/Jm        0
    kg/Jg     -ka/Jg   dg*r/Jg           -(dg+da)/Jg     da/Jg
    0         ka/Ja    0                  da/Ja         -da/Ja
"""
B = """
    0      0       0
    0      0       0
    kT/Jm  -fc/Jm  tau0/Jm
    0      0       0
    0      0       0
"""
SPEED = "0 0 1 0 0"


def printed(*matrices: str) -> Entries:
    rows = [line.split() for text in matrices for line in text.strip().splitlines()]
    every = {(i, j): parse(text) for i, row in enumerate(rows) for j, text in enumerate(row)}
    return {place: value for place, value in every.items() if value}


def test_what_may_be_zero_but_not_negative() -> None:
    """Dampers and friction; offsets have either sign, inertias and springs are positive."""
    parameters = eliminate(THREE_MASSES.flat()).parameters
    assert {p.name for p in parameters if p.nonnegative} == {"dg", "da", "fm", "fc"}
    assert {p.name for p in parameters if p.positive} == {"Jm", "Jg", "Ja", "kg", "ka", "kT", "r"}


def test_the_three_masses_are_the_papers_entry_by_entry() -> None:
    """x = (r phi_m - phi_g, phi_g - phi_a, phi_m', phi_g', phi_a'); torque, Coulomb friction, 1; y = phi_m'."""
    ss = eliminate(THREE_MASSES.flat())
    assert dict(ss.A) == printed(A)
    assert dict(ss.B) == printed(B)
    assert dict(ss.C) == printed(SPEED)
