"""The Modelica files of the project, flattened by pymoca, against the reduced model: from every input to the output."""

import numpy as np
import pytest

from monitor_core.drive.structure import Output
from monitor_core.kernel.tables import COSINE, COULOMB, ONE, SINE, TORQUE
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.modelica import Source, read
from monitor_core.modeling.statespace import drive_of, nominal_of
from tests.service.modeling.flattened import ONE as ONE_KNOWN
from tests.service.modeling.flattened import ROOT, FlatText, numbers
from tests.shares import soaked

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

SHIPPED = {"ThreeMass": "three_mass.mo"}
OUTPUTS: tuple[Output, ...] = ("speed", "angle")
TOLERANCE = 1e-6
DRY = {"fc": 0.3, "tau0": 0.2}
KINDS = {"tau": TORQUE, ONE_KNOWN: ONE, "tanh": COULOMB, "cos": COSINE, "sin": SINE}
"""Of the inputs, by the known or the function.  The same functions of the same motion act through the same paths: with
equal frequency responses the two drives are one from rest, whatever the torque."""


def text_of(model: str, output: Output, gravity: bool = False) -> str:
    """As shipped; the crane with a sensor for what is wanted."""
    if model in SHIPPED:
        return (ROOT / "config" / "drives" / SHIPPED[model]).read_text(encoding="utf-8")
    text = CRANE.replace("SENSOR", "SpeedSensor" if output == "speed" else "AngleSensor")
    return text if gravity else "\n".join(line for line in text.splitlines() if "gravity" not in line)


@pytest.mark.parametrize(
    ("model", "output", "gravity"),
    soaked(
        [
            *((model, output, False) for model in (*SHIPPED, "Crane") for output in OUTPUTS),
            ("Crane", "angle", True),
        ],
        ("ThreeMass", "speed", False),
        ("Crane", "angle", True),
    ),
)
def test_every_input_acts_alike_and_the_functions_are_of_the_same_motion(
    model: str, output: Output, gravity: bool, seed: int
) -> None:
    text = text_of(model, output, gravity)
    ss = eliminate(read([Source("drive.mo", text)], model), output)
    drive, values, flat = drive_of(ss), nominal_of(ss, DRY), FlatText(text, model, DRY)
    given, functions = numbers(flat, "tau"), {f.known: f for f in flat.functions}
    A, B, C = drive.matrix("A", values), drive.matrix("B", values), drive.matrix("C", values)
    kinds = {
        known: KINDS[functions[known].function if known in functions else known] for known in given.knowns
    }
    assert sorted(kinds.values()) == sorted(drive.inputs)
    assert (set(drive.inputs) > {TORQUE, COULOMB, ONE}) == gravity
    for s in 2j * np.pi * np.exp(np.random.default_rng(seed).uniform(np.log(0.1), np.log(100), 10)):
        motion = (C @ np.linalg.solve(s * np.eye(len(A)) - A, B))[0]
        for known, kind in kinds.items():
            column = drive.inputs.index(kind)
            want = given.responses(known, s)
            measured = want["encoder.w" if output == "speed" else "encoder.flange.phi"]
            assert abs(motion[column] - measured) <= TOLERANCE * abs(measured)
            for function in flat.functions:
                ratio = drive.matrix("ratio", values)[drive.inputs.index(kinds[function.known]), 0]
                speed = function.function == "tanh" and output == "angle"
                of_it = sum(float(c) * want[name] for name, c in function.argument.items())
                assert abs(ratio * motion[column] * (s if speed else 1) - of_it) <= TOLERANCE * abs(of_it)
