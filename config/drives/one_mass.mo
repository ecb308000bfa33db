model OneMass "Motor, gear and arm as one stiff mass"
  parameter Modelica.Units.SI.Inertia J = 0.0329 "inertia of motor, gear and arm, on the motor side";
  parameter Modelica.Units.SI.RotationalDampingConstant fm = 0.06 "viscous friction of the motor";
  parameter Modelica.Units.SI.Torque fc = 0 "Coulomb friction of the motor";
  parameter Modelica.Units.SI.Torque tau0 = 0 "torque offset";
  parameter Real kT(unit = "1", min = 1e-3) = 1 "torque constant, relative to the one the controller uses";
  Modelica.Blocks.Interfaces.RealInput tau(unit = "N.m") "motor torque, as measured by the controller"
    annotation(Placement(transformation(extent = {{-200, -20}, {-160, 20}})));
  Modelica.Blocks.Math.Gain torqueConstant(k = kT) "what the torque really is"
    annotation(Placement(transformation(extent = {{-140, -10}, {-120, 10}})));
  Modelica.Mechanics.Rotational.Sources.Torque torque "of the motor"
    annotation(Placement(transformation(extent = {{-110, -10}, {-90, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia motor(J = J) "rotor, gear and arm"
    annotation(Placement(transformation(extent = {{-60, -10}, {-40, 10}})));
  Modelica.Mechanics.Rotational.Sensors.SpeedSensor encoder "on the motor's shaft"
    annotation(Placement(transformation(extent = {{-60, 60}, {-40, 80}})));
  AxisWatch.CoulombFriction friction(fc = fc) "dry, of the motor's bearings"
    annotation(Placement(transformation(extent = {{-110, 60}, {-90, 80}})));
  AxisWatch.TorqueOffset offset(tau0 = tau0) "of the measured torque"
    annotation(Placement(transformation(extent = {{-110, 30}, {-90, 50}})));
  Modelica.Mechanics.Rotational.Components.Damper bearing(d = fm) "viscous friction of the motor"
    annotation(Placement(transformation(origin = {-80, -40}, extent = {{-10, -10}, {10, 10}}, rotation = -90)));
  Modelica.Mechanics.Rotational.Components.Fixed ground "housing"
    annotation(Placement(transformation(extent = {{-90, -80}, {-70, -60}})));
equation
  connect(tau, torqueConstant.u)
    annotation(Line(points = {{-180, 0}, {-142, 0}}, color = {0, 0, 127}));
  connect(torqueConstant.y, torque.tau)
    annotation(Line(points = {{-119, 0}, {-112, 0}}, color = {0, 0, 127}));
  connect(torque.flange, motor.flange_a)
    annotation(Line(points = {{-90, 0}, {-60, 0}}));
  connect(friction.flange, motor.flange_a)
    annotation(Line(points = {{-90, 70}, {-80, 70}, {-80, 0}, {-60, 0}}));
  connect(offset.flange, motor.flange_a)
    annotation(Line(points = {{-90, 40}, {-80, 40}, {-80, 0}, {-60, 0}}));
  connect(encoder.flange, motor.flange_a)
    annotation(Line(points = {{-60, 70}, {-80, 70}, {-80, 0}, {-60, 0}}));
  connect(bearing.flange_a, motor.flange_a)
    annotation(Line(points = {{-80, -30}, {-80, 0}, {-60, 0}}));
  connect(bearing.flange_b, ground.flange)
    annotation(Line(points = {{-80, -50}, {-80, -70}}));
  annotation(
    Diagram(coordinateSystem(extent = {{-200, -100}, {0, 100}})),
    Icon(coordinateSystem(extent = {{-200, -100}, {0, 100}})),
    uses(Modelica(version = "4.0.0"), AxisWatch(version = "0.1.0")));
end OneMass;
