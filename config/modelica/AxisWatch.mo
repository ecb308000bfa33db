within ;
package AxisWatch "What axiswatch knows besides Modelica.Mechanics.Rotational: load this file beside a drawing that uses it"
  model CoulombFriction "Dry friction of a bearing, smooth around standstill; ground is inside"
    parameter Modelica.Units.SI.Torque fc(start = 0) "Coulomb friction";
    parameter Modelica.Units.SI.AngularVelocity speed_scale = 1
      "the friction is fc tanh(w / speed_scale); in axiswatch friction_speed_scale of the axis takes its place";
    Modelica.Mechanics.Rotational.Interfaces.Flange_a flange "shaft"
      annotation(Placement(transformation(extent = {{90, -10}, {110, 10}})));
    Modelica.Units.SI.AngularVelocity w "speed of the shaft";
  equation
    w = der(flange.phi);
    flange.tau = fc * tanh(w / speed_scale);
    annotation(
      Icon(graphics = {
        Rectangle(extent = {{-60, 60}, {60, -60}}, lineColor = {0, 0, 0}, fillColor = {255, 255, 255}, fillPattern = FillPattern.Solid),
        Line(points = {{-50, -30}, {-4, -28}, {4, 28}, {50, 30}}, color = {0, 0, 127}, thickness = 0.5),
        Line(points = {{60, 0}, {100, 0}}),
        Text(extent = {{-150, 110}, {150, 70}}, textString = "%name", textColor = {0, 0, 255}),
        Text(extent = {{-150, -70}, {150, -100}}, textString = "fc=%fc")}));
  end CoulombFriction;

  model Gravity "Weight of an arm; the angle counts from the position where the shaft's angle is zero"
    parameter Modelica.Units.SI.Torque gc(start = 0) "weight times horizontal distance of the centre of mass at angle zero";
    parameter Modelica.Units.SI.Torque gs(start = 0) "minus weight times height of the centre of mass above the axis at angle zero";
    Modelica.Mechanics.Rotational.Interfaces.Flange_a flange "shaft of the arm"
      annotation(Placement(transformation(extent = {{90, -10}, {110, 10}})));
  equation
    flange.tau = gc * cos(flange.phi) + gs * sin(flange.phi);
    annotation(
      Icon(graphics = {
        Rectangle(extent = {{-60, 60}, {60, -60}}, lineColor = {0, 0, 0}, fillColor = {255, 255, 255}, fillPattern = FillPattern.Solid),
        Line(points = {{0, 44}, {0, -30}}, color = {0, 0, 127}, thickness = 0.5),
        Polygon(points = {{-12, -26}, {12, -26}, {0, -50}, {-12, -26}}, lineColor = {0, 0, 127}, fillColor = {0, 0, 127}, fillPattern = FillPattern.Solid),
        Line(points = {{60, 0}, {100, 0}}),
        Text(extent = {{-150, 110}, {150, 70}}, textString = "%name", textColor = {0, 0, 255}),
        Text(extent = {{-150, -70}, {150, -100}}, textString = "gc=%gc, gs=%gs")}));
  end Gravity;

  model TorqueOffset "Constant torque on a shaft: what the controller's torque is off by"
    parameter Modelica.Units.SI.Torque tau0(start = 0) "torque offset";
    Modelica.Mechanics.Rotational.Interfaces.Flange_b flange "shaft"
      annotation(Placement(transformation(extent = {{90, -10}, {110, 10}})));
  equation
    flange.tau = -tau0;
    annotation(
      Icon(graphics = {
        Rectangle(extent = {{-60, 60}, {60, -60}}, lineColor = {0, 0, 0}, fillColor = {255, 255, 255}, fillPattern = FillPattern.Solid),
        Line(points = {{-50, 20}, {50, 20}}, color = {0, 0, 127}, thickness = 0.5),
        Line(points = {{-50, -30}, {50, -30}}, color = {192, 192, 192}),
        Line(points = {{60, 0}, {100, 0}}),
        Text(extent = {{-150, 110}, {150, 70}}, textString = "%name", textColor = {0, 0, 255}),
        Text(extent = {{-150, -70}, {150, -100}}, textString = "tau0=%tau0")}));
  end TorqueOffset;
  annotation(version = "0.1.0", uses(Modelica(version = "4.0.0")));
end AxisWatch;
