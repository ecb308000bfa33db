"""The Modelica files of the project, flattened by pymoca and simulated by scipy, against the reduced model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from monitor_core.drive.structure import Drive, Output
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.modelica import Source, read
from monitor_core.modeling.statespace import drive_of, nominal_of
from tests.service.modeling.descriptor import ordinary, transfer
from tests.service.modeling.flattened import ROOT, FlatText, numbers

Array = NDArray[np.float64]

ROTATIONAL = "Modelica.Mechanics.Rotational"
CRANE = f"""
model Arm "A branch behind a spring with nothing between it and the next, and a balancer on a second gear"
  parameter Real J;
  {ROTATIONAL}.Interfaces.Flange_a flange;
  {ROTATIONAL}.Components.Spring rope(c = 700);
  {ROTATIONAL}.Components.SpringDamper hook(c = 900, d = 2);
  {ROTATIONAL}.Components.Inertia mass(J = J);
  {ROTATIONAL}.Components.IdealGear belt(ratio = 2.5);
  {ROTATIONAL}.Components.Inertia balancer(J = 0.125);
equation
  connect(flange, rope.flange_b);
  connect(rope.flange_a, hook.flange_a);
  connect(hook.flange_b, mass.flange_a);
  connect(mass.flange_b, belt.flange_b);
  connect(belt.flange_a, balancer.flange_a);
end Arm;

model Crane
  parameter Real Jm = 0.25;
  parameter Real r = 0.1;
  parameter Real fc = 0;
  parameter Real tau0 = 0;
  Modelica.Blocks.Interfaces.RealInput tau;
  Modelica.Blocks.Math.Gain motorConstant(k = 1.25);
  {ROTATIONAL}.Sources.Torque torque;
  {ROTATIONAL}.Components.Inertia motor(J = Jm);
  {ROTATIONAL}.Components.IdealGear gear(ratio = 1/r);
  {ROTATIONAL}.Components.Inertia drum(J = 3);
  {ROTATIONAL}.Components.SpringDamper brake(c = 50, d = 7);
  {ROTATIONAL}.Components.Damper oil(d = 0.5);
  {ROTATIONAL}.Components.Fixed house;
  Arm near(J = 2);
  Arm far(J = 5);
  AxisWatch.Gravity gravity(gc = 3, gs = -0.5);
  AxisWatch.CoulombFriction friction(fc = fc);
  AxisWatch.TorqueOffset offset(tau0 = tau0);
  {ROTATIONAL}.Sensors.SENSOR encoder;
equation
  connect(tau, motorConstant.u);
  connect(motorConstant.y, torque.tau);
  connect(torque.flange, motor.flange_a);
  connect(motor.flange_b, gear.flange_a);
  connect(gear.flange_b, drum.flange_a);
  connect(brake.flange_a, drum.flange_b);
  connect(brake.flange_b, house.flange);
  connect(oil.flange_b, motor.flange_a);
  connect(oil.flange_a, house.flange);
  connect(near.flange, drum.flange_b);
  connect(far.flange, drum.flange_b);
  connect(friction.flange, drum.flange_a);
  connect(offset.flange, motor.flange_a);
  connect(gravity.flange, drum.flange_b);
  connect(encoder.flange, motor.flange_b);
end Crane;
"""

SHIPPED = {"TwoMass": "two_mass.mo", "ThreeMass": "three_mass.mo", "FiveMass": "five_mass.mo"}
OUTPUTS: tuple[Output, ...] = ("speed", "angle")
NONE = {"fc": 0.0, "tau0": 0.0}
DRY = {"fc": 0.3, "tau0": 0.2}
TOLERANCE = 1e-6


@dataclass
class Case:
    """One drive read in both ways."""

    drive: Drive
    values: dict[str, float]
    flat: FlatText
    output: str

    def matrices(self) -> tuple[Array, Array, Array]:
        return (
            self.drive.matrix("A", self.values),
            self.drive.matrix("B", self.values),
            self.drive.matrix("C", self.values),
        )


def text_of(model: str, output: Output, gravity: bool = False) -> str:
    """As shipped; the crane with a sensor for what is wanted."""
    if model in SHIPPED:
        return (ROOT / "config" / "drives" / SHIPPED[model]).read_text(encoding="utf-8")
    text = CRANE.replace("SENSOR", "SpeedSensor" if output == "speed" else "AngleSensor")
    return text if gravity else "\n".join(line for line in text.splitlines() if "gravity" not in line)


def case(model: str, output: Output, changes: dict[str, float], gravity: bool = False) -> Case:
    text = text_of(model, output, gravity)
    ss = eliminate(read([Source("drive.mo", text)], model), output)
    measured = "encoder.w" if output == "speed" else "encoder.flange.phi"
    return Case(drive_of(ss), nominal_of(ss, changes), FlatText(text, model, changes), measured)


def steps(seed: int, count: int) -> tuple[Array, Array]:
    """Torques and the ends of their intervals, which are not regular."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal(count), np.cumsum(rng.uniform(0.002, 0.05, count))


def agree(got: Array, want: Array) -> None:
    assert np.abs(got - want).max() <= TOLERANCE * np.abs(want).max()
    assert np.abs(want).max() > 0


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("model", [*SHIPPED, "Crane"])
def test_frequency_response(model: str, output: Output, seed: int) -> None:
    both = case(model, output, NONE)
    given = numbers(both.flat, "tau")
    A, B, C = both.matrices()
    for s in 2j * np.pi * np.exp(np.random.default_rng(seed).uniform(np.log(0.1), np.log(100), 10)):
        column = B[:, both.drive.inputs.index(TORQUE)]
        got = (C @ np.linalg.solve(s * np.eye(len(A)) - A, column))[0]
        want = transfer(given, "tau", both.output, s)
        assert abs(got - want) <= TOLERANCE * abs(want)


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("model", [*SHIPPED, "Crane"])
def test_response_with_coulomb_friction_and_offset(model: str, output: Output, seed: int) -> None:
    both = case(model, output, DRY)
    torque, t = steps(seed, 15)
    agree(with_friction(both, torque, t), ordinary(both.flat, "tau").response(both.output, torque, t))


def test_response_with_gravity_behind_the_gear(seed: int) -> None:
    both = case("Crane", "angle", DRY, gravity=True)
    torque, t = steps(seed, 15)
    assert {COULOMB, ONE, COSINE, SINE} <= set(both.drive.inputs)
    agree(with_friction(both, torque, t), ordinary(both.flat, "tau").response(both.output, torque, t))


def with_friction(both: Case, torque: Array, t: Array) -> Array:
    """The reduced model with its functions of the motion, by scipy's solver, from rest."""
    A, B, C = both.matrices()
    ratio = both.drive.matrix("ratio", both.values)[:, 0]
    speed = C if both.drive.output == "speed" else C @ A

    def derivative(_: float, x: Array, tau: float) -> Array:
        angle, w = ratio * (C @ x)[0], ratio * (speed @ x)[0]
        of_kind = {TORQUE: [tau] * len(ratio), COULOMB: np.tanh(w), ONE: [1.0] * len(ratio)}
        of_kind |= {COSINE: np.cos(angle), SINE: np.sin(angle)}
        u = np.array([of_kind[kind][k] for k, kind in enumerate(both.drive.inputs)])
        return np.asarray(A @ x + B @ u)

    x, y = np.zeros(len(A)), []
    for tau, begin, end in zip(torque, np.concatenate([[0.0], t[:-1]]), t, strict=True):
        found = solve_ivp(derivative, (begin, end), x, "DOP853", rtol=1e-11, atol=1e-14, args=(float(tau),))
        assert found.success, found.message
        x = found.y[:, -1]
        y.append((C @ x)[0])
    return np.array(y)
