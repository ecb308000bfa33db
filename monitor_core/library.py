"""Drives that come with axiswatch, and the reference experiment's values."""

from types import MappingProxyType

from monitor_core.kernel.tables import COULOMB, ONE, TORQUE
from monitor_core.model import Drive, Output, Parameter, Quantity, Term

_INERTIA, _SPRING, _DAMPER = "kg m^2", "N m/rad", "N m s/rad"

_THREE_MASS_PARAMETERS = (
    Parameter("Jm", _INERTIA, "inertia of the motor"),
    Parameter("Jg", _INERTIA, "inertia of the gearbox, arm side"),
    Parameter("Ja", _INERTIA, "inertia of the arm"),
    Parameter("kg", _SPRING, "stiffness of the gearbox, arm side"),
    Parameter("ka", _SPRING, "stiffness of the arm"),
    Parameter("dg", _DAMPER, "damping of the gearbox, arm side", positive=False),
    Parameter("da", _DAMPER, "damping of the arm", positive=False),
    Parameter("fm", _DAMPER, "viscous friction of the motor", positive=False),
    Parameter("fc", "N m", "Coulomb friction of the motor", positive=False),
    Parameter("tau0", "N m", "torque offset", positive=False),
    Parameter("kT", "1", "torque constant, relative to the one the controller uses"),
    Parameter("r", "1", "gear ratio, arm angle over motor angle"),
)

_SPRING_STATES = (Quantity("r phi_m - phi_g", "rad"), Quantity("phi_g - phi_a", "rad"))
_SPEED_STATES = (Quantity("phi_m'", "rad/s"), Quantity("phi_g'", "rad/s"), Quantity("phi_a'", "rad/s"))
_MOTOR, _GEAR, _ARM = 2, 3, 4


def three_mass(output: Output) -> Drive:
    """The three-mass drive of the paper (eq. 1-2), with Coulomb friction and torque offset as inputs.

    Output speed: five states, y = phi_m'.  Output angle: an integrator is added, six states, y = phi_m.
    """
    speed_output = output == "speed"
    states: tuple[Quantity, ...] = _SPRING_STATES + _SPEED_STATES
    if not speed_output:
        states += (Quantity("phi_m", "rad"),)
    return Drive(
        name="three-mass",
        output=output,
        states=states,
        inputs=(TORQUE, COULOMB, ONE),
        parameters=_THREE_MASS_PARAMETERS,
        terms=_EQUATIONS + (_SPEED_OUTPUT if speed_output else _ANGLE_OUTPUT),
        speed_state=_MOTOR,
    )


def _A(row: int, col: int, coefficient: float, **powers: int) -> Term:
    return Term("A", row, col, coefficient, tuple(powers.items()))


def _B(col: int, coefficient: float, **powers: int) -> Term:
    return Term("B", _MOTOR, col, coefficient, tuple(powers.items()))


_EQUATIONS = (
    # (r phi_m - phi_g)' and (phi_g - phi_a)'
    _A(0, _MOTOR, 1, r=1),
    _A(0, _GEAR, -1),
    _A(1, _GEAR, 1),
    _A(1, _ARM, -1),
    # Jm phi_m'' = kT u - fm phi_m' - r (kg (r phi_m - phi_g) + dg (r phi_m' - phi_g')) - fc tanh + tau0
    _A(_MOTOR, 0, -1, kg=1, r=1, Jm=-1),
    _A(_MOTOR, _MOTOR, -1, fm=1, Jm=-1),
    _A(_MOTOR, _MOTOR, -1, dg=1, r=2, Jm=-1),
    _A(_MOTOR, _GEAR, 1, dg=1, r=1, Jm=-1),
    _B(0, 1, kT=1, Jm=-1),
    _B(1, -1, fc=1, Jm=-1),
    _B(2, 1, tau0=1, Jm=-1),
    # Jg phi_g'' = kg (..) + dg (r phi_m' - phi_g') - ka (phi_g - phi_a) - da (phi_g' - phi_a')
    _A(_GEAR, 0, 1, kg=1, Jg=-1),
    _A(_GEAR, 1, -1, ka=1, Jg=-1),
    _A(_GEAR, _MOTOR, 1, dg=1, r=1, Jg=-1),
    _A(_GEAR, _GEAR, -1, dg=1, Jg=-1),
    _A(_GEAR, _GEAR, -1, da=1, Jg=-1),
    _A(_GEAR, _ARM, 1, da=1, Jg=-1),
    # Ja phi_a'' = ka (phi_g - phi_a) + da (phi_g' - phi_a')
    _A(_ARM, 1, 1, ka=1, Ja=-1),
    _A(_ARM, _GEAR, 1, da=1, Ja=-1),
    _A(_ARM, _ARM, -1, da=1, Ja=-1),
)

_SPEED_OUTPUT = (
    Term("C", 0, _MOTOR, 1, ()),
    Term("rest", _MOTOR, 0, 1, ()),
    Term("rest", _GEAR, 0, 1, (("r", 1),)),
    Term("rest", _ARM, 0, 1, (("r", 1),)),
)

_ANGLE_OUTPUT = (_A(5, _MOTOR, 1), Term("C", 0, 5, 1, ()), Term("rest", 5, 0, 1, ()))

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
