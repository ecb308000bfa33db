"""The part of Modelica's standard library and of AxisWatch that drives need: names, connectors, parameters.

The physics of the components is in monitor_core.modeling.components; this module assigns its kinds to the names.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

from pymoca import ast
from pymoca.parser import file_to_tree

from monitor_core.modeling.modelica.parsing import Source, parse

ROTATIONAL = "Modelica.Mechanics.Rotational"
SOURCES = "Modelica.Blocks.Sources"

_SHAPES = (
    *("Clock", "CombiTimeTable", "Constant", "ContinuousClock", "Cosine", "ExpSine", "Exponentials"),
    *("KinematicPTP", "KinematicPTP2", "LogFrequencySweep", "Pulse", "Ramp", "RealExpression", "SawTooth"),
    *("Sinc", "Sine", "SineVariableFrequencyAndAmplitude", "Step", "TimeTable", "Trapezoid"),
)
"""Sources of signals; their shapes do not matter, as the signal is replaced by the measured torque."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """A kind of component_kinds.py; ``roles``: its roles by the names that their parameters have in Modelica.

    ``fixed``: values of roles that Modelica's component does not have.
    """

    kind: str
    roles: Mapping[str, str] = field(default_factory=dict)
    fixed: Mapping[str, int] = field(default_factory=dict)


BEARING, SIGNAL_SOURCE = "bearing-friction", "signal-source"
"""Kinds that are not in component_kinds.py: friction by a table of speeds; the measured torque."""

LEAVES: Mapping[str, Leaf] = {
    f"{ROTATIONAL}.Components.Inertia": Leaf("inertia", {"J": "J"}),
    f"{ROTATIONAL}.Components.Spring": Leaf("spring", {"c": "c"}),
    f"{ROTATIONAL}.Components.Damper": Leaf("damper", {"d": "d"}),
    f"{ROTATIONAL}.Components.SpringDamper": Leaf("spring-damper", {"c": "c", "d": "d"}),
    f"{ROTATIONAL}.Components.IdealGear": Leaf("ideal-gear", {"ratio": "ratio"}),
    f"{ROTATIONAL}.Components.Fixed": Leaf("fixed"),
    f"{ROTATIONAL}.Components.BearingFriction": Leaf(BEARING),
    f"{ROTATIONAL}.Sources.Torque": Leaf("torque", fixed={"kT": 1}),
    f"{ROTATIONAL}.Sources.ConstantTorque": Leaf("torque-offset", {"tau0": "tau_constant"}),
    f"{ROTATIONAL}.Sensors.SpeedSensor": Leaf("speed-sensor"),
    f"{ROTATIONAL}.Sensors.AngleSensor": Leaf("angle-sensor"),
    "Modelica.Blocks.Math.Gain": Leaf("gain", {"k": "k"}),
    "AxisWatch.CoulombFriction": Leaf("coulomb-friction", {"fc": "fc"}),
    "AxisWatch.Gravity": Leaf("gravity", {"gc": "gc", "gs": "gs"}),
    "AxisWatch.TorqueOffset": Leaf("torque-offset", {"tau0": "tau0"}),
    f"{SOURCES}.Source": Leaf(SIGNAL_SOURCE),
}

REFUSED: Mapping[str, tuple[bool | int, str]] = {
    "useSupport": (False, "a housing that moves is not supported: leave useSupport at false"),
    "useHeatPort": (False, "heat is not modelled: leave useHeatPort at false"),
    "peak": (1, "only peak = 1 is supported: static friction is not higher than sliding friction here"),
}
"""Parameters of library components that may have only this value, with the reason."""

_UNITS: Mapping[str, str] = {
    "Angle": "rad",
    "AngularVelocity": "rad/s",
    "AngularAcceleration": "rad/s2",
    "Torque": "N.m",
    "Inertia": "kg.m2",
    "MomentOfInertia": "kg.m2",
    "RotationalSpringConstant": "N.m/rad",
    "RotationalDampingConstant": "N.m.s/rad",
    "Mass": "kg",
    "Length": "m",
    "Radius": "m",
    "Diameter": "m",
    "Distance": "m",
    "Height": "m",
    "Breadth": "m",
    "Thickness": "m",
    "Position": "m",
    "Area": "m2",
    "Density": "kg/m3",
    "Velocity": "m/s",
    "Acceleration": "m/s2",
    "Force": "N",
    "Time": "s",
    "Frequency": "Hz",
    "AngularFrequency": "rad/s",
    "Power": "W",
    "Energy": "J",
    "Current": "A",
    "Voltage": "V",
    "Resistance": "Ohm",
    "Inductance": "H",
    "ElectricalTorqueConstant": "N.m/A",
    "TranslationalSpringConstant": "N/m",
    "TranslationalDampingConstant": "N.s/m",
    "Efficiency": "1",
    "DimensionlessRatio": "1",
}

_TEXT = """
package Modelica
  package Units package SI %(types)s end SI; end Units;
  package SIunits %(types)s end SIunits;
  package Constants
    constant Real pi = 3.141592653589793;
    constant Real e = 2.718281828459045;
    constant Real D2R = 0.017453292519943295 "rad per degree";
    constant Real R2D = 57.29577951308232 "degrees per rad";
    constant Real g_n(unit = "m/s2") = 9.80665;
  end Constants;
  package Blocks
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
      partial block SO RealOutput y; end SO;
      partial block SI RealInput u; end SI;
      partial block SISO RealInput u; RealOutput y; end SISO;
    end Interfaces;
    package Math
      block Gain parameter Real k; Interfaces.RealInput u; Interfaces.RealOutput y; end Gain;
    end Math;
    package Sources
      block Source Interfaces.RealOutput y; end Source; %(shapes)s
    end Sources;
  end Blocks;
  package Mechanics package Rotational
    package Interfaces
      connector Flange Units.SI.Angle phi; flow Units.SI.Torque tau; end Flange;
      connector Flange_a = Flange;
      connector Flange_b = Flange;
      partial model PartialTwoFlanges Flange_a flange_a; Flange_b flange_b; end PartialTwoFlanges;
      partial model PartialOneFlange Flange_b flange; end PartialOneFlange;
      partial model PartialOneFlangeAndSupport
        parameter Boolean useSupport = false; Flange_b flange;
      end PartialOneFlangeAndSupport;
      partial model PartialTwoFlangesAndSupport
        parameter Boolean useSupport = false; extends PartialTwoFlanges;
      end PartialTwoFlangesAndSupport;
      partial model PartialElementaryTwoFlangesAndSupport2
        extends PartialTwoFlangesAndSupport;
      end PartialElementaryTwoFlangesAndSupport2;
      partial model PartialCompliant
        extends PartialTwoFlanges; Units.SI.Angle phi_rel; Units.SI.Torque tau;
      equation
        phi_rel = flange_b.phi - flange_a.phi; flange_b.tau = tau; flange_a.tau = -tau;
      end PartialCompliant;
      partial model PartialCompliantWithRelativeStates
        extends PartialCompliant; Units.SI.AngularVelocity w_rel; Units.SI.AngularAcceleration a_rel;
        parameter StateSelect stateSelect; parameter Units.SI.Angle phi_nominal = 1;
      equation
        w_rel = der(phi_rel); a_rel = der(w_rel);
      end PartialCompliantWithRelativeStates;
      partial model PartialAbsoluteSensor Flange_a flange; end PartialAbsoluteSensor;
    end Interfaces;
      package Bases "without equations, as the components: those are in component_kinds.py"
      partial model Compliant
        extends Interfaces.PartialTwoFlanges; Units.SI.Angle phi_rel; Units.SI.Torque tau;
      end Compliant;
      partial model WithRelativeStates
        extends Compliant; Units.SI.AngularVelocity w_rel; Units.SI.AngularAcceleration a_rel;
        parameter StateSelect stateSelect; parameter Units.SI.Angle phi_nominal = 1;
        parameter Boolean useHeatPort = false;
      end WithRelativeStates;
      partial model Sensor Interfaces.Flange_a flange; end Sensor;
    end Bases;
    package Components
      model Inertia
        extends Interfaces.PartialTwoFlanges; parameter Units.SI.Inertia J; parameter StateSelect stateSelect;
        Units.SI.Angle phi; Units.SI.AngularVelocity w; Units.SI.AngularAcceleration a;
      end Inertia;
      model Spring
        extends Bases.Compliant; parameter Units.SI.RotationalSpringConstant c;
        parameter Units.SI.Angle phi_rel0 = 0;
      end Spring;
      model Damper extends Bases.WithRelativeStates; parameter Units.SI.RotationalDampingConstant d; end Damper;
      model SpringDamper
        extends Bases.WithRelativeStates; parameter Units.SI.RotationalSpringConstant c;
        parameter Units.SI.RotationalDampingConstant d; parameter Units.SI.Angle phi_rel0 = 0;
      end SpringDamper;
      model IdealGear
        extends Interfaces.PartialTwoFlanges; parameter Real ratio(unit = "1");
        parameter Boolean useSupport = false;
      end IdealGear;
      model Fixed Interfaces.Flange_b flange; parameter Units.SI.Angle phi0 = 0; end Fixed;
      model BearingFriction
        extends Interfaces.PartialTwoFlanges; parameter Real tau_pos[:, 2]; parameter Real peak = 1;
        parameter Boolean useSupport = false; parameter Boolean useHeatPort = false;
        parameter StateSelect stateSelect;
      end BearingFriction;
    end Components;
    package Sources
      model Torque
        parameter Boolean useSupport = false; Interfaces.Flange_b flange; Blocks.Interfaces.RealInput tau;
      end Torque;
      model ConstantTorque
        parameter Boolean useSupport = false; Interfaces.Flange_b flange;
        parameter Units.SI.Torque tau_constant;
      end ConstantTorque;
    end Sources;
    package Sensors
      model SpeedSensor extends Bases.Sensor; Blocks.Interfaces.RealOutput w(unit = "rad/s"); end SpeedSensor;
      model AngleSensor extends Bases.Sensor; Blocks.Interfaces.RealOutput phi(unit = "rad"); end AngleSensor;
    end Sensors;
  end Rotational; end Mechanics;
end Modelica;
package AxisWatch
  model CoulombFriction
    Modelica.Mechanics.Rotational.Interfaces.Flange_a flange; parameter Modelica.Units.SI.Torque fc;
    parameter Modelica.Units.SI.AngularVelocity speed_scale = 1;
  end CoulombFriction;
  model Gravity
    Modelica.Mechanics.Rotational.Interfaces.Flange_a flange;
    parameter Modelica.Units.SI.Torque gc; parameter Modelica.Units.SI.Torque gs;
  end Gravity;
  model TorqueOffset
    Modelica.Mechanics.Rotational.Interfaces.Flange_b flange; parameter Modelica.Units.SI.Torque tau0;
  end TorqueOffset;
end AxisWatch;
"""


@cache
def library() -> ast.Tree:
    """The library's classes, parsed once: copy them before anything is added."""
    types = " ".join(f'type {name} = Real(unit = "{unit}");' for name, unit in _UNITS.items())
    shapes = " ".join(f"block {name} = Source;" for name in _SHAPES)
    return file_to_tree(parse(Source("", _TEXT % {"types": types, "shapes": shapes})))
