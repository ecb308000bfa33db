"""Chains of any number of masses: a motor, a gear, masses on springs, friction and a weight on the last."""

from functools import cache
from typing import Literal

from monitor_core.drive.structure import Drive, Output
from monitor_core.modeling.drawing import Drawing, part
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.standard_drives import DRAWINGS
from monitor_core.modeling.statespace import drive_of

Sensor = Literal["motor", "gear"]


def one_mass(output: Output) -> Drive:
    """The library's drive of one mass: kT, J, fm, fc, tau0."""
    return drive_of(eliminate(DRAWINGS["one-mass"].flat(), output))


@cache
def chain(masses: int, output: Output, sensor: Sensor = "motor", gravity: bool = True) -> Drive:
    """Masses J1, J2 .. joined by k1, d1, k2, d2 ..: the first is the motor, the second hangs on the gear.

    A sensor behind the gear has r times the motor's angle.  Without gravity the speed may be the output.
    """
    last = f"mass{masses}" if masses > 1 else "gear"
    components = [
        part("torque", "torque", "motor", kT="kT"),
        part("inertia", "motor", "motor", J="J1"),
        part("viscous-friction", "bearing", "motor", d="f"),
        part("coulomb-friction", "friction", "motor", fc="fc"),
        part("torque-offset", "offset", "motor", tau0="tau0"),
        part("ideal-gear", "gear", "motor", "gear", ratio=Laurent.symbol("r", -1)),
        part("coulomb-friction", "seal", last, fc="fa"),
        part("speed-sensor", "encoder", sensor),
    ]
    before = "gear"
    for i in range(1, masses):
        node = f"mass{i + 1}"
        components.append(part("spring-damper", f"spring{i}", node, before, c=f"k{i}", d=f"d{i}"))
        components.append(part("inertia", node, node, J=f"J{i + 1}"))
        before = node
    if gravity:
        components.append(part("gravity", "weight", last, gc="gc", gs="gs"))
    return drive_of(eliminate(Drawing(f"{masses} masses", components).flat(), output))


def values(masses: int, gravity: bool = True) -> dict[str, float]:
    """Values on the motor side like those of the reference drive, however many masses share them."""
    r = 0.1
    found = {"J1": 0.006, "f": 0.06, "fc": 0.3, "tau0": 0.1, "kT": 1.0, "r": r, "fa": 0.2 / r}
    for i in range(1, masses):
        found[f"J{i + 1}"] = (0.027 + 0.001 * i) / (masses - 1) / r**2
        found[f"k{i}"] = (12.0 + 3.0 * i) * (masses - 1) / r**2
        found[f"d{i}"] = 0.02 / i * (masses - 1) / r**2
    return found | ({"gc": 0.8 / r, "gs": 0.5 / r} if gravity else {})
