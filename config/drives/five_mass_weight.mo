model FiveMassWeight "Motor, and four masses behind the gear, numbered outwards, with the weight of the arm"
  parameter Modelica.Units.SI.Inertia Jm = 5.9e-3 "inertia of the motor";
  parameter Modelica.Units.SI.Inertia J1 = 111.392 "inertia of the mass 1, arm side";
  parameter Modelica.Units.SI.Inertia J2 = 167.088 "inertia of the mass 2, arm side";
  parameter Modelica.Units.SI.Inertia J3 = 64.0504 "inertia of the mass 3, arm side";
  parameter Modelica.Units.SI.Inertia J4 = 33.4176 "inertia of the mass 4, arm side";
  parameter Modelica.Units.SI.RotationalSpringConstant k1 = 389872 "stiffness of the spring 1, arm side";
  parameter Modelica.Units.SI.RotationalSpringConstant k2 = 626580 "stiffness of the spring 2, arm side";
  parameter Modelica.Units.SI.RotationalSpringConstant k3 = 529112 "stiffness of the spring 3, arm side";
  parameter Modelica.Units.SI.RotationalSpringConstant k4 = 167088 "stiffness of the spring 4, arm side";
  parameter Modelica.Units.SI.RotationalDampingConstant d1 = 696.2 "damping of the spring 1, arm side";
  parameter Modelica.Units.SI.RotationalDampingConstant d2 = 556.96 "damping of the spring 2, arm side";
  parameter Modelica.Units.SI.RotationalDampingConstant d3 = 278.48 "damping of the spring 3, arm side";
  parameter Modelica.Units.SI.RotationalDampingConstant d4 = 139.24 "damping of the spring 4, arm side";
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
  Modelica.Mechanics.Rotational.Components.SpringDamper spring1(c = k1, d = d1) "spring 1"
    annotation(Placement(transformation(extent = {{0, -10}, {20, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia mass1(J = J1) "mass 1"
    annotation(Placement(transformation(extent = {{30, -10}, {50, 10}})));
  Modelica.Mechanics.Rotational.Components.SpringDamper spring2(c = k2, d = d2) "spring 2"
    annotation(Placement(transformation(extent = {{60, -10}, {80, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia mass2(J = J2) "mass 2"
    annotation(Placement(transformation(extent = {{90, -10}, {110, 10}})));
  Modelica.Mechanics.Rotational.Components.SpringDamper spring3(c = k3, d = d3) "spring 3"
    annotation(Placement(transformation(extent = {{120, -10}, {140, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia mass3(J = J3) "mass 3"
    annotation(Placement(transformation(extent = {{150, -10}, {170, 10}})));
  Modelica.Mechanics.Rotational.Components.SpringDamper spring4(c = k4, d = d4) "spring 4"
    annotation(Placement(transformation(extent = {{180, -10}, {200, 10}})));
  Modelica.Mechanics.Rotational.Components.Inertia mass4(J = J4) "mass 4"
    annotation(Placement(transformation(extent = {{210, -10}, {230, 10}})));
  AxisWatch.Gravity weight(gc = gc, gs = gs) "of the arm"
    annotation(Placement(transformation(extent = {{210, -60}, {230, -40}})));
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
  connect(gear.flange_b, spring1.flange_a)
    annotation(Line(points = {{-10, 0}, {0, 0}}));
  connect(spring1.flange_b, mass1.flange_a)
    annotation(Line(points = {{20, 0}, {30, 0}}));
  connect(mass1.flange_b, spring2.flange_a)
    annotation(Line(points = {{50, 0}, {60, 0}}));
  connect(spring2.flange_b, mass2.flange_a)
    annotation(Line(points = {{80, 0}, {90, 0}}));
  connect(mass2.flange_b, spring3.flange_a)
    annotation(Line(points = {{110, 0}, {120, 0}}));
  connect(spring3.flange_b, mass3.flange_a)
    annotation(Line(points = {{140, 0}, {150, 0}}));
  connect(mass3.flange_b, spring4.flange_a)
    annotation(Line(points = {{170, 0}, {180, 0}}));
  connect(spring4.flange_b, mass4.flange_a)
    annotation(Line(points = {{200, 0}, {210, 0}}));
  connect(mass4.flange_b, weight.flange)
    annotation(Line(points = {{230, 0}, {240, 0}, {240, -50}, {230, -50}}));
  annotation(
    Diagram(coordinateSystem(extent = {{-200, -100}, {260, 100}})),
    Icon(coordinateSystem(extent = {{-200, -100}, {260, 100}})),
    uses(Modelica(version = "4.0.0"), AxisWatch(version = "0.1.0")));
end FiveMassWeight;
