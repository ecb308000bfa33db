"""Drives of one mass for real axes, and their records through the program's own reader."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from monitor_core.drive.structure import Drive
from monitor_core.modeling.elimination import eliminate
from monitor_core.modeling.modelica import Source, read
from monitor_core.modeling.statespace import drive_of
from service.ingest.records.loaded_records import Loaded, load
from tests.service.ingest.plant import axis1, make_config

ONE_MASS = """model Axis "A mass with friction and an offset; its angle is measured"
  import Modelica.Mechanics.Rotational.*;
  parameter Real kT(unit = "1", min = 1e-3) = 1;
  parameter Modelica.Units.SI.Inertia J(min = 0) = 1;
  parameter Modelica.Units.SI.RotationalDampingConstant fv(min = 0) = 1;
  parameter Modelica.Units.SI.Torque fc(min = 0) = 1;
  parameter Modelica.Units.SI.Torque tau0 = 0;
  Modelica.Blocks.Interfaces.RealInput tau(unit = "N.m");
  Modelica.Blocks.Math.Gain torqueConstant(k = kT);
  Sources.Torque motor;
  Components.Inertia mass(J = J);
  Components.Damper bearing(d = fv);
  Components.Fixed housing;
  AxisWatch.CoulombFriction seal(fc = fc);
  AxisWatch.TorqueOffset offset(tau0 = tau0);
  Sensors.AngleSensor encoder;
equation
  connect(tau, torqueConstant.u);
  connect(torqueConstant.y, motor.tau);
  connect(motor.flange, mass.flange_a);
  connect(bearing.flange_a, mass.flange_a);
  connect(bearing.flange_b, housing.flange);
  connect(seal.flange, mass.flange_a);
  connect(offset.flange, mass.flange_a);
  connect(encoder.flange, mass.flange_a);
end Axis;
"""
WEIGHT = """\
  parameter Modelica.Units.SI.Torque gc = 0;
  parameter Modelica.Units.SI.Torque gs = 0;
  AxisWatch.Gravity weight(gc = gc, gs = gs);
equation
  connect(weight.flange, mass.flange_a);
"""


@cache
def one_mass(*, gravity: bool = False) -> Drive:
    """The drive of that text, or the same with a weight."""
    text = ONE_MASS.replace("equation\n", WEIGHT) if gravity else ONE_MASS
    return drive_of(eliminate(read([Source("axis.mo", text)])))


def loaded(path: Path, folder: Path, interval_s: float, columns: Mapping[str, dict[str, Any]]) -> Loaded:
    """The record in a file, by a configuration (made in ``folder``) with these columns: torque, angle, time."""
    axis = axis1(time=columns["time"], sample_interval_s=interval_s, pairing_tolerance_s=0.4 * interval_s)
    for name in ("torque", "angle"):
        axis[name] |= columns[name]
    return load(str(path), make_config(folder, axis), "r.one")
