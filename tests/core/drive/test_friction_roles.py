"""Which parameters of a drive are friction, whatever they are called, and what brakes a lasting motion."""

import pytest

from monitor_core.drive.friction_roles import braking, friction_of
from monitor_core.drive.structure import Output
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.standard_drives import REFERENCE_VALUES, five_mass, three_mass
from monitor_core.modeling.statespace import drive_of

VALUES = REFERENCE_VALUES | {"fc": 0.7}
NAMED_OTHERWISE = Drawing(
    "own_names",
    [
        part("torque", "torque", "shaft", kT="kT"),
        part("inertia", "motor", "shaft", J="m1"),
        part("viscous-friction", "bearing", "shaft", d="fv"),
        part("coulomb-friction", "seal", "shaft", fc="fs"),
        part("ideal-gear", "gearbox", "shaft", "output", ratio=Laurent.symbol("n", -1)),
        part("spring-damper", "belt", "load", "output", c="k", d="d"),
        part("inertia", "arm", "load", J="m2"),
        part("viscous-friction", "far_bearing", "load", d="fl"),
        part("speed-sensor", "encoder", "shaft"),
    ],
)


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_friction_of_library_drives(output: Output) -> None:
    for drive in (three_mass(output), five_mass(output)):
        assert friction_of(drive) == (("fm",), ("fc",))
    assert braking(three_mass(output), VALUES) == pytest.approx((VALUES["fm"], 0.7))


@pytest.mark.parametrize("output", ["speed", "angle"])
def test_friction_of_a_drawn_drive_is_found_by_its_place(output: Output) -> None:
    """A damper between two masses is none; friction behind a gear counts with the square of its ratio."""
    drive = drive_of(eliminate(NAMED_OTHERWISE.flat(), output))
    assert {*friction_of(drive).viscous} == {"fv", "fl"}
    assert friction_of(drive).coulomb == ("fs",)
    values = {
        "kT": 1.0,
        "m1": 1e-3,
        "m2": 2.0,
        "fv": 0.05,
        "fs": 0.4,
        "n": 0.1,
        "k": 100.0,
        "d": 0.3,
        "fl": 2.0,
    }
    assert braking(drive, values) == pytest.approx((0.05 + 0.1**2 * 2.0, 0.4))
