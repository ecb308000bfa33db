"""Names of classes: packages, imports, base classes, several texts, the library's own."""

from __future__ import annotations

import pytest

from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.modelica.texts import COMPONENTS, ROTATIONAL, drive, flat, values

INERTIA = f"{COMPONENTS}.Inertia"
ONE = {"motor.J": 1.0, "arm.J": 2.0}


@pytest.mark.parametrize(
    "declarations",
    [
        f"{INERTIA} arm(J = 2);",
        f".{INERTIA} arm(J = 2);",
        f"import {INERTIA}; Inertia arm(J = 2);",
        f"import I = {INERTIA}; I arm(J = 2);",
        f"import {COMPONENTS}.*; Inertia arm(J = 2);",
        f"import {COMPONENTS}.{{Spring, Inertia}}; Inertia arm(J = 2);",
        "import Modelica.Mechanics.Rotational; Rotational.Components.Inertia arm(J = 2);",
        f"import R = {ROTATIONAL}; R.Components.Inertia arm(J = 2);",
        "import Modelica.Math.*; import Modelica.Constants; import Nobody.Uses.This; "
        f"{INERTIA} arm(J = 2);",
        f"model Inner = {INERTIA}; Inner arm(J = 2);",
        f"model Inner extends {INERTIA}(J = 2); end Inner; Inner arm;",
        f"package P import R = {ROTATIONAL}; model Inner = R.Components.Inertia; end P; P.Inner arm(J = 2);",
        f"model Inner extends Base; end Inner; model Base = {INERTIA}; Inner arm(J = 2);",
    ],
)  # fmt: skip
def test_ways_to_name_a_class(declarations: str) -> None:
    assert values(flat(drive(declarations))) == ONE


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + drive(),
        drive().replace("\n", "\r\n"),
        drive() + "// the end",
        "/* a drive */ " + drive(),
        "within;" + drive(),
        drive().replace("end D;", "annotation(__Vendor(what only = 1 vendor, knows));\nend D;"),
        drive().replace("end D;", 'annotation(Icon(graphics = {Text(textString = "%name;)")}), x = [1; 2]);\nend D;'),
    ],
)
def test_what_editors_add(text: str) -> None:
    assert flat(text).equations == flat(drive()).equations


def test_classes_of_enclosing_packages_and_base_classes() -> None:
    text = f"""
package Lib
  constant Real two = 2;
  package Base
    import {COMPONENTS}.Inertia;
    partial model Kit
      model Arm = Inertia(J = two);
    end Kit;
  end Base;
  package Robots
    model Drive
      extends Lib.Base.Kit;
      Arm arm;
      Motor motor(J = 1);
      {ROTATIONAL}.Sources.Torque torque;
      {ROTATIONAL}.Sensors.SpeedSensor encoder;
    equation
      connect(torque.flange, motor.flange_a);
      connect(motor.flange_b, encoder.flange);
    end Drive;
    model Motor = {INERTIA};
  end Robots;
end Lib;
"""
    model = flat(text)
    assert model.name == "Drive"
    assert values(model) == {"motor.J": 1.0, "arm.J": 2.0}


def test_several_texts_with_within() -> None:
    package = "within ;\npackage Lib\n  constant Real two = 2;\nend Lib;"
    arm = f"within Lib.Parts;\nmodel Arm = {INERTIA}(J = two);"
    used = drive("Lib.Parts.Arm arm;")
    model = read([Source("a.mo", used), Source("b.mo", arm), Source("c.mo", package)])
    assert values(model) == ONE
    assert {p.name: (p.origin.file, p.origin.line) for p in model.parameters} == {
        "motor.J": ("a.mo", 3),
        "arm.J": ("a.mo", 5),
    }


def test_a_users_own_class_comes_before_the_librarys() -> None:
    text = drive("Inertia arm;", before=f"model Inertia = {INERTIA}(J = 2); ")
    assert values(flat(text)) == ONE


def test_axiswatchs_own_library_may_be_among_the_texts() -> None:
    own = Source(
        "AxisWatch.mo",
        "package AxisWatch model Gravity Real x; equation x = sin(x); end Gravity; end AxisWatch;",
    )
    text = drive("AxisWatch.Gravity weight(gc = 3, gs = 4);", "connect(weight.flange, motor.flange_b);")
    model = read([own, Source("d.mo", text)])
    assert values(model) == {"motor.J": 1, "weight.gc": 3, "weight.gs": 4}
    assert [i.name for i in model.inputs] == ["torque.tau", "weight.cosine", "weight.sine"]


@pytest.mark.parametrize("within", ["AxisWatch", "Modelica.Blocks", "Modelica.Mechanics.Rotational.Components"])
def test_the_library_cannot_be_changed_from_a_text(within: str) -> None:
    own = Source("own.mo", f"within {within}; model Inertia Real x = 1; end Inertia;")
    assert read([own, Source("d.mo", drive())]).equations == flat(drive()).equations
    assert flat(drive()).equations == flat(drive()).equations


def test_a_base_class_by_two_ways_is_there_once() -> None:
    base = "Modelica.Mechanics.Rotational.Interfaces.PartialTwoFlanges"
    kit = f"""partial model Kit extends {base}; parameter Real J = 2; end Kit;
      model Arm extends {base}; extends Kit; {INERTIA} mass(J = J);
      equation connect(flange_a, mass.flange_a); connect(mass.flange_b, flange_b); end Arm; """
    text = drive("Arm arm;", "connect(motor.flange_b, arm.flange_a);", kit)
    assert values(flat(text)) == {"motor.J": 1, "arm.J": 2}


def test_pictures_may_be_extended() -> None:
    flat(drive("extends Modelica.Icons.RotationalSensor; extends Modelica.Mechanics.Rotational.Icons.Gear;"))


def test_a_type_of_ones_own() -> None:
    text = 'type Mass = Real(final unit = "kg.m2", min = 0); type Heavy = Mass; '
    (only,) = flat(drive("parameter Heavy Jm = 3;", motor="J = Jm", before=text)).parameters
    assert (only.unit, only.value) == ("kg m^2", 3.0)
