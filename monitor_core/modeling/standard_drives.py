"""The drives of the library in the form of the kernel, and the values of the reference experiment."""

from collections.abc import Sequence
from functools import cache
from types import MappingProxyType

from monitor_core.drive.axis_model import AxisModel
from monitor_core.drive.structure import Drive, Output
from monitor_core.modeling import drive_drawings as drawings
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.statespace import drive_of


@cache
def two_mass(output: Output) -> Drive:
    """Motor and arm: three states with the motor speed as output, four with the motor angle."""
    return drive_of(eliminate(drawings.two_mass().flat(), output))


@cache
def three_mass(output: Output) -> Drive:
    """The three-mass drive of the paper (eq. 1-2), with Coulomb friction and torque offset as inputs.

    Output speed: five states, y = phi_m'.  Output angle: an integrator is added, six states, y = phi_m.
    """
    return drive_of(eliminate(drawings.three_mass().flat(), output))


@cache
def five_mass(output: Output) -> Drive:
    """Motor and four masses in a row: nine states with the motor speed as output, ten with the motor angle."""
    return drive_of(eliminate(drawings.five_mass().flat(), output))


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

MONITORED = ("kT", "1/Ja", "fm")
INTERVAL_S = 0.005
"""Sample interval of the reference experiment [s]."""


def reference_model(output: Output = "speed", monitored: Sequence[str] = MONITORED) -> AxisModel:
    """The embedded default drive, with the parameters that the paper monitors."""
    return AxisModel(three_mass(output), REFERENCE_VALUES, tuple(monitored))
