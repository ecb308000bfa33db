model ThreeMassWeight "Motor, gearbox and arm (the drive of the reference experiment), with the weight of the arm"
  parameter Modelica.Units.SI.Inertia Jm = 5.896e-3 "inertia of the motor";
  parameter Modelica.Units.SI.Inertia Jg = 280.526828 "inertia of the gearbox, arm side";
  parameter Modelica.Units.SI.Inertia Ja = 95.713576 "inertia of the arm";
  parameter Modelica.Units.SI.RotationalSpringConstant kg = 286736.932 "stiffness of the gearbox, arm side";
  parameter Modelica.Units.SI.RotationalSpringConstant ka = 281696.444 "stiffness of the arm";
  parameter Modelica.Units.SI.RotationalDampingConstant dg = 869.13608 "damping of the gearbox, arm side";
  parameter Modelica.Units.SI.RotationalDampingConstant da = 137.4995 "damping of the arm";
  parameter Modelica.Units.SI.RotationalDampingConstant fm = 0.06 "viscous friction of the motor";
  parameter Modelica.Units.SI.Torque fc = 0 "Coulomb friction of the motor";
  parameter Modelica.Units.SI.Torque tau0 = 0 "torque offset";
  parameter Real kT(unit = "1", min = 1e-3) = 1 "torque constant, relative to the one the controller uses";
  parameter Real r(unit = "1") = 1/118 "gear ratio, arm angle over motor angle";
  parameter Modelica.Units.SI.Torque gc = 0 "torque of the weight on the arm at the angle zero, as where the arm lies flat there";
  parameter Modelica.Units.SI.Torque gs = 0 "torque of the weight on the arm a quarter of a turn further";
  Modelica.Blocks.Interfaces.RealInput tau(unit = "N.m") "motor torque, as measured by the controller"
    annotation(Placement(transformation(extent = {{-200, -20}, {-160, 20}})));
  Modelica.Blocks.Math.Gain torqueConstant(k = kT) "what the torque really is"
    annotation(Placement(transformation(extent = {{-140, -10}, {-120, 10}})));
  Modelica.Mechanics.Rotational.Sources.Torque torque "of the motor"
    annotation(Placement(transformation(extent = {{-110, -10}, {-90, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia motor(J = Jm) "rotor"
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
  Modelica.Mechanics.Rotational.Components.IdealGear gear(ratio = 1/r) "from the motor's to the arm's side"
    annotation(Placement(transformation(extent = {{-30, -10}, {-10, 10}})));
  Modelica.Mechanics.Rotational.Components.SpringDamper gearSpring(c = kg, d = dg) "gearbox"
    annotation(Placement(transformation(extent = {{0, -10}, {20, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia gearbox(J = Jg) "gearbox"
    annotation(Placement(transformation(extent = {{30, -10}, {50, 10}})));
  Modelica.Mechanics.Rotational.Components.SpringDamper armSpring(c = ka, d = da) "arm"
    annotation(Placement(transformation(extent = {{60, -10}, {80, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia arm(J = Ja) "arm"
    annotation(Placement(transformation(extent = {{90, -10}, {110, 10}})));
  AxisWatch.Gravity weight(gc = gc, gs = gs) "of the arm"
    annotation(Placement(transformation(extent = {{90, -60}, {110, -40}})));
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
  connect(motor.flange_b, gear.flange_a)
    annotation(Line(points = {{-40, 0}, {-30, 0}}));
  connect(gear.flange_b, gearSpring.flange_a)
    annotation(Line(points = {{-10, 0}, {0, 0}}));
  connect(gearSpring.flange_b, gearbox.flange_a)
    annotation(Line(points = {{20, 0}, {30, 0}}));
  connect(gearbox.flange_b, armSpring.flange_a)
    annotation(Line(points = {{50, 0}, {60, 0}}));
  connect(armSpring.flange_b, arm.flange_a)
    annotation(Line(points = {{80, 0}, {90, 0}}));
  connect(arm.flange_b, weight.flange)
    annotation(Line(points = {{110, 0}, {120, 0}, {120, -50}, {110, -50}}));
  annotation(
    Diagram(coordinateSystem(extent = {{-200, -100}, {140, 100}})),
    Icon(coordinateSystem(extent = {{-200, -100}, {140, 100}})),
    uses(Modelica(version = "4.0.0"), AxisWatch(version = "0.1.0")));
end ThreeMassWeight;
