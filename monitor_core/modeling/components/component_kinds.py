"""The kinds of components of a drive: flanges, parameters, equations.

One definition serves drawings (drawing.py) and Modelica texts (modelica/).  Names, signs and equations are those of
Modelica's standard library: ``tau`` of a flange is the torque that acts on the component there, and angles count from
rest, where no spring is under tension.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE
from monitor_core.modeling.components.fragments import Builder, Fragment, LinearForm, der
from monitor_core.modeling.flat import CONSTANT, Origin
from monitor_core.modeling.laurent import Laurent


@dataclass(frozen=True, slots=True)
class Role:
    """A parameter of a kind of component, with its required unit ("": any).

    ``positive``: the value must be above zero.  ``signed``: a given number may still be negative (a gear that
    reverses), but not zero.  ``nonnegative``: an identified value must not be negative (a damper that drives).
    """

    name: str
    unit: str
    meaning: str
    positive: bool = False
    signed: bool = False
    nonnegative: bool = False

    def problem(self, value: float) -> str:
        """Requirement that a value violates ("must be greater than zero"); empty if the value is valid."""
        if not abs(value) < float("inf"):
            return "must be finite"
        if self.positive and value == 0:
            return "must not be zero" if self.signed else "must be greater than zero"
        return "must be greater than zero" if self.positive and value < 0 and not self.signed else ""


@dataclass(frozen=True, slots=True)
class ComponentKind:
    """A kind of component: its connectors, its parameters, and ``physics``, which writes its equations."""

    name: str
    flanges: tuple[str, ...]
    roles: tuple[Role, ...]
    physics: Callable[[Builder], None]
    signals_in: tuple[str, ...] = ()
    signals_out: tuple[str, ...] = ()

    def role(self, name: str) -> Role:
        """The parameter of that name."""
        return {role.name: role for role in self.roles}[name]


def fragment(kind: ComponentKind, name: str, parameters: Mapping[str, Laurent], origin: Origin) -> Fragment:
    """Variables, equations, inputs and sensors of a component, all named "<name>.<what>"; all roles have parameters.

    A signal into the component is a variable here; the ``tau`` of a torque without a connection is the measured one:
    ``Fragment.measured``.
    """
    builder = Builder(name, parameters, origin)
    kind.physics(builder)
    return builder.fragment


_ZERO = LinearForm({})

# --- masses and what joins them ------------------------------------------------------------------------


def _inertia(c: Builder) -> None:
    at_a, at_b = c.flange("flange_a"), c.flange("flange_b")
    phi = c.variable("phi", "rad", prefer=True)
    w = c.variable("w", "rad/s")
    a = c.variable("a", "rad/s^2")
    c.equal(phi, at_a.phi)
    c.equal(phi, at_b.phi)
    c.equal(w, der(phi))
    c.equal(a, der(w))
    c.equal(a * c["J"], at_a.tau + at_b.tau)


def _fixed(c: Builder) -> None:
    c.equal(c.flange("flange").phi, _ZERO)


def _compliant(c: Builder) -> tuple[LinearForm, LinearForm]:
    """The deflection, and the torque from flange_b to flange_a."""
    at_a, at_b = c.flange("flange_a"), c.flange("flange_b")
    phi_rel = c.variable("phi_rel", "rad", relative=True)
    tau = c.variable("tau", "N m")
    c.equal(phi_rel, at_b.phi - at_a.phi)
    c.equal(at_b.tau, tau)
    c.equal(at_a.tau, -tau)
    return phi_rel, tau


def _relative_speed(c: Builder, phi_rel: LinearForm) -> LinearForm:
    w_rel, a_rel = c.variable("w_rel", "rad/s"), c.variable("a_rel", "rad/s^2")
    c.equal(w_rel, der(phi_rel))
    c.equal(a_rel, der(w_rel))
    return w_rel


def _spring(c: Builder) -> None:
    phi_rel, tau = _compliant(c)
    c.equal(tau, phi_rel * c["c"])


def _damper(c: Builder) -> None:
    phi_rel, tau = _compliant(c)
    c.equal(tau, _relative_speed(c, phi_rel) * c["d"])


def _spring_damper(c: Builder) -> None:
    phi_rel, tau = _compliant(c)
    c.equal(tau, phi_rel * c["c"] + _relative_speed(c, phi_rel) * c["d"])


def _ideal_gear(c: Builder) -> None:
    at_a, at_b = c.flange("flange_a"), c.flange("flange_b")
    c.equal(at_a.phi, at_b.phi * c["ratio"])
    c.equal(_ZERO, at_a.tau * c["ratio"] + at_b.tau)


# --- torques -------------------------------------------------------------------------------------------


def _viscous_friction(c: Builder) -> None:
    flange, w = c.flange("flange"), c.variable("w", "rad/s")
    c.equal(w, der(flange.phi))
    c.equal(flange.tau, w * c["d"])


def _coulomb_friction(c: Builder) -> None:
    direction = c.input(f"{c.name}.direction", COULOMB, angle="flange.phi")
    c.equal(c.flange("flange").tau, direction * c["fc"])


def _gravity(c: Builder) -> None:
    cosine = c.input(f"{c.name}.cosine", COSINE, angle="flange.phi")
    sine = c.input(f"{c.name}.sine", SINE, angle="flange.phi")
    c.equal(c.flange("flange").tau, cosine * c["gc"] + sine * c["gs"])


def _torque_offset(c: Builder) -> None:
    c.equal(c.flange("flange").tau, -c.input(CONSTANT, ONE) * c["tau0"])


def _torque(c: Builder) -> None:
    c.equal(c.flange("flange").tau, -c.variable("tau", "N m") * c["kT"])


# --- sensors and signals -------------------------------------------------------------------------------


def _speed_sensor(c: Builder) -> None:
    flange = c.flange("flange")
    c.equal(c.variable("w", "rad/s"), der(flange.phi))
    c.equal(flange.tau, _ZERO)
    c.sensor("flange.phi", "speed")


def _angle_sensor(c: Builder) -> None:
    flange = c.flange("flange")
    c.equal(c.variable("phi", "rad"), flange.phi)
    c.equal(flange.tau, _ZERO)
    c.sensor("flange.phi", "angle")


def _gain(c: Builder) -> None:
    u, y = c.variable("u", ""), c.variable("y", "")
    c.equal(y, u * c["k"])


_BOTH, _ONE = ("flange_a", "flange_b"), ("flange",)
_J = Role("J", "kg m^2", "inertia", positive=True)
_C = Role("c", "N m/rad", "stiffness", positive=True)
_D = Role("d", "N m s/rad", "damping", nonnegative=True)
# angle at flange_a over angle at flange_b
_RATIO = Role("ratio", "1", "ratio", positive=True, signed=True)
_VISCOUS = Role("d", "N m s/rad", "viscous friction", nonnegative=True)
_FC = Role("fc", "N m", "Coulomb friction", nonnegative=True)
_GC = Role("gc", "N m", "gravity torque by the cosine")
_GS = Role("gs", "N m", "gravity torque by the sine")
_TAU0 = Role("tau0", "N m", "torque offset")
# relative to the one that the controller uses
_KT = Role("kT", "1", "torque constant", positive=True)
_K = Role("k", "", "gain")

COMPONENT_KINDS: Mapping[str, ComponentKind] = MappingProxyType(
    {
        kind.name: kind
        for kind in (
            ComponentKind("inertia", _BOTH, (_J,), _inertia),
            ComponentKind("fixed", _ONE, (), _fixed),
            ComponentKind("spring", _BOTH, (_C,), _spring),
            ComponentKind("damper", _BOTH, (_D,), _damper),
            ComponentKind("spring-damper", _BOTH, (_C, _D), _spring_damper),
            ComponentKind("ideal-gear", _BOTH, (_RATIO,), _ideal_gear),
            ComponentKind("viscous-friction", _ONE, (_VISCOUS,), _viscous_friction),
            ComponentKind("coulomb-friction", _ONE, (_FC,), _coulomb_friction),
            ComponentKind("gravity", _ONE, (_GC, _GS), _gravity),
            ComponentKind("torque-offset", _ONE, (_TAU0,), _torque_offset),
            ComponentKind("torque", _ONE, (_KT,), _torque, signals_in=("tau",)),
            ComponentKind("speed-sensor", _ONE, (), _speed_sensor, signals_out=("w",)),
            ComponentKind("angle-sensor", _ONE, (), _angle_sensor, signals_out=("phi",)),
            ComponentKind("gain", (), (_K,), _gain, signals_in=("u",), signals_out=("y",)),
        )
    }
)
"""Every kind by its name."""
