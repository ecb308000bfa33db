"""The drives of the library, as they are drawn and in the form of the kernel; values of the reference experiment.

A motor, a gear, and masses behind it, connected by springs in a chain.  Angles behind the gear are those of the arm: r
times the motor's.  Each spring is drawn so that its deflection is the angle on the motor's side less the angle on the
arm's side, as in the paper: r phi_m - phi_g, phi_g - phi_a.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import NamedTuple, get_args

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive, Output
from monitor_core.modeling.drawing import Drawing, DriveComponent, part
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.statespace import drive_of
from monitor_core.wording import listed

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


class _Link(NamedTuple):
    """A mass behind the gear, with the spring and damper that connect it to the previous one; names of parameters.

    ``mass`` and ``spring`` describe them in words; ``name`` is that of the mass in the drawing.
    """

    name: str
    mass: str
    J: str
    spring: str
    k: str
    d: str


def _drawings() -> Iterator[Drawing]:
    gearbox = _Link("gearbox", "gearbox, arm side", "Jg", "gearbox, arm side", "kg", "dg")
    links = {
        "two-mass": [_Link("arm", "arm", "Ja", "gearbox, arm side", "k", "d")],
        "three-mass": [gearbox, _Link("arm", "arm", "Ja", "arm", "ka", "da")],
        "five-mass": [
            _Link(f"mass{i}", f"mass {i}, arm side", f"J{i}", f"spring {i}, arm side", f"k{i}", f"d{i}")
            for i in range(1, 5)
        ],
    }
    yield Drawing("one-mass", _motor("J"), _MASS | _MOTOR)
    yield Drawing("one-mass-weight", [*_motor("J"), _GEARBOX, _weight("gear")], _MASS | _MOTOR | _WEIGHT | _GEAR)
    for name, behind in links.items():
        drive = _chain(name, behind)
        yield drive
        # The weight turns with r times the angle of the motor; the deflection of the springs changes it little.
        heavy = [*drive.components, _weight(behind[-1].name)]
        yield Drawing(f"{name}-weight", heavy, {**drive.meanings, **_WEIGHT})


def _chain(name: str, links: Sequence[_Link]) -> Drawing:
    """Motor and gear, and the links behind it in a chain; the motor's speed is measured."""
    meanings = {"Jm": "inertia of the motor"}
    meanings |= {link.J: f"inertia of the {link.mass}" for link in links}
    meanings |= {link.k: f"stiffness of the {link.spring}" for link in links}
    meanings |= {link.d: f"damping of the {link.spring}" for link in links}
    components = [*_motor("Jm"), _GEARBOX]
    before = "gear"
    for link in links:
        components.append(part("spring-damper", f"{link.name}_spring", link.name, before, c=link.k, d=link.d))
        components.append(part("inertia", link.name, link.name, J=link.J))
        before = link.name
    return Drawing(name, components, meanings | _MOTOR | _GEAR)


_GEARBOX = part("ideal-gear", "gear", "motor", "gear", ratio=Laurent.symbol("r", -1))


def _weight(node: str) -> DriveComponent:
    return part("gravity", "weight", node, gc="gc", gs="gs")


def _motor(J: str) -> list[DriveComponent]:
    """The motor with this inertia, its friction and its sensor."""
    return [
        part("torque", "torque", "motor", kT="kT"),
        part("inertia", "motor", "motor", J=J),
        part("viscous-friction", "bearing", "motor", d="fm"),
        part("coulomb-friction", "friction", "motor", fc="fc"),
        part("torque-offset", "offset", "motor", tau0="tau0"),
        part("speed-sensor", "encoder", "motor"),
    ]


DRAWINGS: Mapping[str, Drawing] = MappingProxyType({drive.name: drive for drive in _drawings()})
"""By name: one to five masses, each also with the weight of the arm.  The one of three masses is the drive of the paper
(eq. 1-2) with Coulomb friction and torque offset; that of five masses its accurate drive, numbered outwards."""


@cache
def _drive(name: str, output: Output) -> Drive:
    if output not in get_args(Output):
        raise ValueError(f"output {output!r}: must be {listed([repr(known) for known in get_args(Output)], 'or')}")
    if output == "mean speed":  # a drawing has no such sensor
        return _drive(name, "speed").with_mean_speed()
    return drive_of(eliminate(DRAWINGS[name].flat(), output))


def two_mass(output: Output) -> Drive:
    """Motor and arm: three states with the motor speed as output, four with the motor angle or the mean speed.

    ``output``: the measured quantity: "speed" [rad/s], "angle" [rad], or "mean speed" over each interval [rad/s].

    Raises:
        ValueError: another output.
    """
    return _drive("two-mass", output)


def three_mass(output: Output) -> Drive:
    """The three-mass drive of the paper (eq. 1-2), with Coulomb friction and torque offset as inputs.

    Output speed: five states, y = phi_m'.  Output angle: an integrator is added, six states, y = phi_m; so it is for
    the mean speed.  ``output`` and errors as of ``two_mass``.
    """
    return _drive("three-mass", output)


def five_mass(output: Output) -> Drive:
    """Motor and four masses in a row: nine states with the motor speed as output, ten with the angle or the mean speed.

    ``output`` and errors as of ``two_mass``.
    """
    return _drive("five-mass", output)


_R = 1 / 118

REFERENCE_VALUES = MappingProxyType(
    {
        "Jm": 5.896e-3,
        "Jg": 2.0147e-2 / _R**2,
        "Ja": 6.874e-3 / _R**2,
        "kg": 20.593 / _R**2,
        "ka": 20.231 / _R**2,
        "dg": 0.06242 / _R**2,
        "da": 9.875e-3 / _R**2,
        "fm": 0.06,
        "fc": 0.0,
        "tau0": 0.0,
        "kT": 1.0,
        "r": _R,
    }
)
"""Nominal values of the reference experiment.  The paper prints none; with these its Figures 5 and 6 come out.
Inertias, springs and dampers: values on the motor side from Wernholt and Gunnarsson (SYSID 2006), moved to the arm
side by 1/r^2; fm read from the thresholds in the paper's Figure 6."""

_MASSES: Mapping[str, Mapping[str, float]] = {
    "one-mass": {"J": 0.0329},
    "two-mass": {"Ja": 376.240404, "k": 222784.0, "d": 556.96},
    "three-mass": REFERENCE_VALUES,
    "five-mass": {
        "Jm": 5.9e-3, "J1": 111.392, "J2": 167.088, "J3": 64.0504, "J4": 33.4176,
        "k1": 389872.0, "k2": 626580.0, "k3": 529112.0, "k4": 167088.0,
        "d1": 696.2, "d2": 556.96, "d3": 278.48, "d4": 139.24,
    },
}  # fmt: skip


def _example_values(drawing: Drawing) -> dict[str, float]:
    known = {**REFERENCE_VALUES, **_MASSES[drawing.name.removesuffix("-weight")], "gc": 0.0, "gs": 0.0}
    return {name: known[name] for name in drawing.meanings}


EXAMPLE_VALUES: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {name: _example_values(drawing) for name, drawing in DRAWINGS.items()}
)
"""Values of a robot like that of the reference experiment, by the drive's name: to show what such a drive does."""

MONITORED = ("kT", "1/Ja", "fm")
INTERVAL_S = 0.005
"""Sample interval of the reference experiment [s]."""


def reference_model(output: Output = "speed", monitored: Sequence[str] = MONITORED) -> AxisModel:
    """The axis of the reference experiment: the three-mass drive with ``REFERENCE_VALUES``.

    ``monitored``: names of parameters; by default those that the paper monitors.  Errors as of ``AxisModel``.
    """
    return AxisModel(three_mass(output), REFERENCE_VALUES, tuple(monitored))
