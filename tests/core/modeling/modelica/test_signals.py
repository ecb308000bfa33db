"""Which signal is the measured motor torque, and which sensors are the outputs."""

from __future__ import annotations

import pytest

from monitor_core.kernel.tables import ONE, TORQUE
from tests.core.modeling.modelica.texts import COMPONENTS, ROTATIONAL, drive, flat
from tests.core.modeling.modelica.transfer import PRIME, responses

U, Y = "Modelica.Blocks.Interfaces.RealInput", "Modelica.Blocks.Interfaces.RealOutput"
GAIN, STEP = "Modelica.Blocks.Math.Gain", "Modelica.Blocks.Sources.Step"
MODULE = f"""model Actuator
  {U} command; {GAIN} gain(k = 3); {ROTATIONAL}.Sources.Torque torque; {ROTATIONAL}.Interfaces.Flange_b flange;
equation
  connect(command, gain.u); connect(gain.y, torque.tau); connect(torque.flange, flange);
end Actuator; """


@pytest.mark.parametrize(
    ("declarations", "equations", "name", "factor"),
    [
        ("", "", "torque.tau", 1),
        (f"{U} u;", "connect(u, torque.tau);", "u", 1),
        (f"{U} u;", "connect(torque.tau, u);", "u", 1),
        (f"{U} u;", "connect(torque.tau, u); connect(u, torque.tau);", "u", 1),
        (f"{U} u;", "torque.tau = 3*u;", "u", 3),
        ("input Real u;", "torque.tau = 3*u;", "u", 3),
        ("connector In = input Real; In u;", "connect(u, torque.tau);", "u", 1),
        (f"{U} u; {U} spare;", "connect(u, torque.tau);", "u", 1),
        (f"{U} spare;", "", "torque.tau", 1),
        (f"{GAIN} g(k = 3); {U} u;", "connect(u, g.u); connect(g.y, torque.tau);", "u", 3),
        (f"{GAIN} g(k = 3); {U} u;", "g.u = u; connect(g.y, torque.tau);", "u", 3),
        (f"{STEP} s(height = 2, startTime = 1, foo = 4);", "connect(s.y, torque.tau);", "s.y", 1),
        ("Modelica.Blocks.Sources.CombiTimeTable t(table = [0, 1; 2, 3]);", "connect(t.y[1], torque.tau);", "t.y", 1),
        (f"{STEP} s; {GAIN} g(k = 3);", "connect(s.y, g.u); connect(g.y, torque.tau);", "s.y", 3),
        (f"import Modelica.Blocks.Sources.*; Sine s(f = 3); {STEP} unused;", "connect(s.y, torque.tau);", "s.y", 1),
    ],
)  # fmt: skip
def test_the_measured_torque(declarations: str, equations: str, name: str, factor: int) -> None:
    model = flat(drive(declarations, equations))
    assert [(i.name, i.kind) for i in model.inputs] == [(name, TORQUE)]
    assert name not in {v.name for v in model.variables}
    values = {"motor.J": 5, "g.k": 3}
    response = responses(model, values.__getitem__, s=7)
    assert response == {("speed", 0): {TORQUE: factor * pow(5 * 7, -1, PRIME) % PRIME}}


def test_torque_of_a_sub_model() -> None:
    text = MODULE + f"""model D
      Actuator a; {U} u; {COMPONENTS}.Inertia motor(J = 5); {ROTATIONAL}.Sensors.AngleSensor encoder;
    equation
      connect(u, a.command); connect(a.flange, motor.flange_a); connect(motor.flange_b, encoder.flange);
    end D;"""  # fmt: skip
    model = flat(text)
    assert [i.name for i in model.inputs] == ["u"]
    response = responses(model, {"motor.J": 5, "a.gain.k": 3}.__getitem__, s=7)
    assert response == {("angle", 0): {TORQUE: 3 * pow(5 * 7 * 7, -1, PRIME) % PRIME}}


SENSORS = f"{ROTATIONAL}.Sensors.AngleSensor second; {ROTATIONAL}.Sensors.SpeedSensor third;"
AT = "connect(second.flange, motor.flange_b); connect(third.flange, motor.flange_b);"


@pytest.mark.parametrize(
    ("declarations", "equations", "names"),
    [
        ("", "", ["encoder", "second", "third"]),
        (f"{Y} y;", "connect(second.phi, y);", ["second"]),
        (f"{Y} y;", "connect(y, second.phi);", ["second"]),
        (f"{Y} y; {Y} z;", "connect(y, third.w); connect(encoder.w, z);", ["encoder", "third"]),
        (f"{Y} y;", "y = motor.a;", ["encoder", "second", "third"]),
        (f"{Y} y; {Y} z;", "y = motor.a; connect(third.w, z);", ["third"]),
        ("connector Out = output Real; Out y(unit = \"rad/s\");", "connect(third.w, y);", ["third"]),
    ],
)  # fmt: skip
def test_outputs(declarations: str, equations: str, names: list[str]) -> None:
    model = flat(drive(SENSORS + declarations, AT + equations))
    assert [s.name for s in model.sensors] == names


def test_a_sensor_in_a_sub_model_is_an_output_through_its_signal() -> None:
    module = (
        f"model Encoder {ROTATIONAL}.Interfaces.Flange_a flange; {ROTATIONAL}.Sensors.SpeedSensor inner_; {Y} w;"
        " equation connect(flange, inner_.flange); connect(inner_.w, w); end Encoder; "
    )
    model = flat(drive(f"Encoder e; {Y} y;", "connect(e.flange, motor.flange_b); connect(e.w, y);", module))
    assert [(s.name, s.angle) for s in model.sensors] == [("e.inner_", "e.inner_.flange.phi")]


@pytest.mark.parametrize(
    "source",
    ["AxisWatch.TorqueOffset t(tau0 = 3)", f"{ROTATIONAL}.Sources.ConstantTorque t(tau_constant = 3)"],
)
def test_a_constant_torque_drives_on(source: str) -> None:
    """J w' = u + tau0: the sign of Modelica's torque sources."""
    model = flat(drive(f"{source};", "connect(t.flange, motor.flange_a);"))
    assert [(i.name, i.kind) for i in model.inputs] == [("torque.tau", TORQUE), ("1", ONE)]
    per_torque = pow(5 * 7, -1, PRIME)
    response = responses(model, lambda name: 5 if name == "motor.J" else 3, s=7)
    assert response == {("speed", 0): {TORQUE: per_torque, ONE: 3 * per_torque % PRIME}}
