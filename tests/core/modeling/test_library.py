"""The drives that come with the program: their names, and the paper's three-mass drive entry by entry."""

from collections.abc import Callable
from typing import Any

import pytest

from monitor_core.drive.structure import Drive
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.standard_drives import DRAWINGS, five_mass, three_mass, two_mass
from monitor_core.modeling.statespace import Entries
from tests.core.modeling.expressions import parse

THREE_MASSES = DRAWINGS["three-mass"]


def test_the_parameters_of_the_three_masses_in_words() -> None:
    """Dampers and friction are not negative; offsets have either sign, inertias and springs are positive."""
    signs = {(True, False): "+", (False, True): "0+", (False, False): ""}
    parameters = eliminate(THREE_MASSES.flat()).parameters
    assert all(p.value is None for p in parameters)
    assert [(p.name, p.unit, p.meaning, signs[p.positive, p.nonnegative]) for p in parameters] == [
        ("Jm", "kg m^2", "inertia of the motor", "+"),
        ("Jg", "kg m^2", "inertia of the gearbox, arm side", "+"),
        ("Ja", "kg m^2", "inertia of the arm", "+"),
        ("kg", "N m/rad", "stiffness of the gearbox, arm side", "+"),
        ("ka", "N m/rad", "stiffness of the arm", "+"),
        ("dg", "N m s/rad", "damping of the gearbox, arm side", "0+"),
        ("da", "N m s/rad", "damping of the arm", "0+"),
        ("fm", "N m s/rad", "viscous friction of the motor", "0+"),
        ("fc", "N m", "Coulomb friction of the motor", "0+"),
        ("tau0", "N m", "torque offset", ""),
        ("kT", "1", "torque constant, relative to the one the controller uses", "+"),
        ("r", "1", "gear ratio, arm angle over motor angle", "+"),
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


def test_the_three_masses_are_the_papers_entry_by_entry() -> None:
    """x = (r phi_m - phi_g, phi_g - phi_a, phi_m', phi_g', phi_a'); torque, Coulomb friction, 1; y = phi_m'."""
    ss = eliminate(THREE_MASSES.flat())
    assert dict(ss.A) == printed(A)
    assert dict(ss.B) == printed(B)
    assert dict(ss.C) == printed(SPEED)


@pytest.mark.parametrize("drive", [two_mass, three_mass, five_mass])
def test_each_output_gives_a_drive_with_it(drive: Callable[[Any], Drive]) -> None:
    outputs = ("speed", "angle", "mean speed")
    assert tuple(drive(output).output for output in outputs) == outputs
    assert drive("mean speed") == drive("speed").with_mean_speed()
    with pytest.raises(ValueError, match="output 'speeds': must be 'speed', 'angle' or 'mean speed'"):
        drive("speeds")
