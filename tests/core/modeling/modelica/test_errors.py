"""Mistakes, and what is not supported: each is told with file, line and component."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.modelica import Source, read
from tests.core.modeling.modelica.texts import COMPONENTS, INTERFACES, ROTATIONAL, drive, flat


class Mistake(NamedTuple):
    text: str
    line: int
    component: str
    problem: str


DRIVE = drive()
SYNTAX = {
    "semicolon": Mistake(DRIVE.replace("motor(J = 1);", "motor(J = 1)"), 3, "", '";" is missing behind ")"'),
    "connect": Mistake(DRIVE.replace("motor.flange_a);", "motor.flange_a;"), 7, "", '")" is expected here'),
    "value": Mistake(drive(motor="J = "), 3, "", 'syntax error: ")" cannot stand behind "="'),
    "number as name": Mistake(drive("Real 3x;"), 5, "", '"3" cannot stand behind "Real"'),
    "annotation": Mistake(drive("Real x = 1 annotation(Placement(;"), 5, "", '";" cannot stand behind "("'),
    "behind an annotation": Mistake(drive("Real x = 1 annotation(a = {[1; 2], (3)})\n y;"), 6, "", '"y" cannot stand'),
    "character": Mistake(drive("Real § = 1;"), 5, "", "§ is not Modelica"),
    "no end": Mistake(DRIVE.replace("end D;", ""), 8, "",
                      'the text ends inside of model D (line 1): is "end D;" missing?'),
    "no end of the inner": Mistake("package P\n model M\nend P;",
                                   3, "", 'model M (line 2) has no "end M;" before "end P;"'),
    "other end": Mistake(DRIVE.replace("end D;", "end E;"), 10, "", 'model D (line 1) ends with "end E;"'),
    "no class": Mistake("foo", 1, "", '"foo" cannot stand outside of a class'),
    "after the end": Mistake(DRIVE + "\nconnect(a, b);", 12, "", '"connect" cannot stand'),
    "twice": Mistake(drive("Real torque;"), 5, "", "torque already defined"),
    "class twice": Mistake("model A end A;\nmodel A end A;", 2, "", "A is declared twice"),
    "inner class twice": Mistake("package P\nmodel A end A;\nmodel A end A;\nend P;",
                                 3, "", "A is declared twice"),
}  # fmt: skip

CLASSES = {
    "misspelt": Mistake(drive(f"{COMPONENTS}.Inertai arm;"), 5, "arm",
                        f"{COMPONENTS}.Inertai is not supported: did you mean Inertia?; there is Inertia, Spring"),
    "without its package": Mistake(drive("Inertia arm;"), 5, "arm", f"did you mean {COMPONENTS}.Inertia?"),
    "not supported": Mistake(drive(f"{COMPONENTS}.LossyGear arm;"),
                             5, "arm", "LossyGear is not supported; there is Inertia"),
    "old type": Mistake(drive("parameter Modelica.SIunits.Torq m;"), 5, "m", "did you mean Torque?"),
    "base": Mistake("model D\n extends Foo;\nend D;", 2, "D", "class Foo is not known"),
    "extends in a ring": Mistake("model A extends B; end A;\nmodel B extends C; end B;\nmodel C extends A; end C;",
                                 1, "A", "A extends itself: A -> B -> C -> A"),
    "contain each other": Mistake("model A\n B b;\nend A;\nmodel B\n A a;\nend B;",
                                  5, "b.a", "A contains itself, as b.a"),
    "partial": Mistake(drive(f"{INTERFACES}.PartialTwoFlanges p;"),
                       5, "p", "PartialTwoFlanges is partial: use a model"),
    "package": Mistake(drive("Modelica.Constants p;"),
                       5, "p", "Constants is a package, not the class of a component"),
    "function": Mistake("function f\n input Real x;\nend f;\n" + drive("f g;"), 8, "g", "f is a function"),
    "of another form": Mistake("type A = der(f, x);\n" + drive("A a;"), 1, "", "a class of this form"),
    "algorithm": Mistake(DRIVE.replace("end D;", "algorithm\n x := 1;\nend D;"),
                         10, "", "an algorithm is not supported: write its linear equations out"),
    "external": Mistake(DRIVE.replace("end D;", 'external "C";\nend D;'),
                        2, "", "an external function is not supported"),
    "declared in two bases": Mistake("model A\n Real x;\nend A;\nmodel B\n Real x;\n extends A;\nend B;",
                                     5, "x", "x is declared in B and in its base class A"),
}  # fmt: skip

MODIFICATIONS = {
    "unknown": Mistake(drive(motor="Jm = 1"), 3, "motor", "Inertia has no Jm; there is flange_a, flange_b, J"),
    "misspelt": Mistake(drive(motor="J = 1, stateselect = 1"),
                        3, "motor", "no stateselect: did you mean stateSelect?"),
    "inside": Mistake("model A\n model B Real x = 1; end B;\n B b;\nend A;\n" + drive("A a(b(y = 2));"),
                      9, "a", "B has no y; there is x"),
    "by extends": Mistake("model A\n Real x = 1;\nend A;\nmodel B\n extends A(\n  y = 2);\nend B;",
                          6, "B", "A has no y; there is x"),
    "attribute": Mistake(drive(motor="J(stat = 1) = 1"),
                         3, "motor", "Real motor has no stat: did you mean start?"),
    "twice": Mistake(drive(motor="J = 1, J = 2"), 3, "motor", "J is given twice"),
    "final": Mistake("model A\n final parameter Real x = 2;\nend A;\n" + drive("A a(x = 3);"), 8, "a",
                     "x is final and cannot be changed from outside"),
    "redeclare": Mistake("model A\nend A;\n" + drive("A a(redeclare model X = Y);"),
                         7, "", '"redeclare" is not supported: write the model'),
    "support": Mistake(drive(f"{COMPONENTS}.IdealGear g(ratio = 2, useSupport = true);"), 5, "g",
                       "useSupport = true: a housing that moves is not supported"),
    "heat": Mistake(drive(f"{COMPONENTS}.Damper g(d = 2, useHeatPort = true);"),
                    5, "g", "useHeatPort = true: heat is not"),
    "peak": Mistake(drive(f"{COMPONENTS}.BearingFriction b(tau_pos = [0, 1; 1, 2], peak = 1.2);"),
                    5, "b", "only peak = 1"),
    "Stribeck": Mistake(drive(f"{COMPONENTS}.BearingFriction b(tau_pos = [0, 1; 1, 2; 3, 4]);"), 5, "b",
                        "tau_pos has 3 points (a Stribeck curve)"),
    "no table": Mistake(drive(f"{COMPONENTS}.BearingFriction b;"),
                        5, "b", "tau_pos is not given; write tau_pos = [0, fc;"),
    "no matrix": Mistake(drive(f"{COMPONENTS}.BearingFriction b(tau_pos = 3);"), 5, "b", "tau_pos must be a table"),
    "three columns": Mistake(drive(f"{COMPONENTS}.BearingFriction b(tau_pos = [0, 1, 2]);"),
                             5, "b", "a speed and a torque"),
    "one speed": Mistake(drive(f"{COMPONENTS}.BearingFriction b(tau_pos = [0, 1; 0, 2]);"), 5, "b", "must differ"),
    "record": Mistake("record R\n Real J;\nend R;\n" + drive("parameter R r = R(J = 3);", motor="J = r.J"),
                      8, "", "a call with named arguments is not supported"),
    "whole record": Mistake("record R\n Real J;\nend R;\n" + drive("parameter R r = R(3); R s = r;"),
                            8, "r", "function R is not supported"),
    "array": Mistake(drive(f"{COMPONENTS}.Inertia arm[3](each J = 1);"), 5, "arm", "arrays are not supported"),
    "inner": Mistake(drive("inner Real g;"), 5, "", '"inner" and "outer" are not supported'),
    "replaceable": Mistake(drive(f"replaceable {COMPONENTS}.Inertia i;"), 5, "", '"replaceable" is not supported'),
}  # fmt: skip

VALUES = {
    "unknown name": Mistake(drive("parameter Real abc = 2;", motor="J = abd"),
                            3, "motor", "abd is not known in D"),
    "unknown name, near": Mistake(drive("parameter Real inertia1 = 2;", motor="J = inertia2"), 3, "motor",
                                  "did you mean inertia1?"),
    "unknown part": Mistake(drive("parameter Real x = motor.K;", motor="J = x"), 5, "x", "motor has no K"),
    "not Laurent": Mistake(drive("parameter Real a = 2; parameter Real b = 3;", motor="J = 1/(a + b)"),
                           3, "motor.J",
                           "a + b is not a single product, so a division by it is not supported"),
    "root": Mistake(drive("parameter Real a = 2;", motor="J = sqrt(a)"), 3, "motor.J", "sqrt of a parameter (a)"),
    "broken power": Mistake(drive("parameter Real a = 2;", motor="J = a^0.5"),
                            3, "motor.J", "(a)^(1/2) is not a whole power"),
    "parameter as exponent": Mistake(drive("parameter Real a = 2;", motor="J = 2^a"),
                                     3, "motor.J", "the exponent a is not a number"),
    "unknown function": Mistake(drive(motor="J = foo(1)"),
                                3, "motor", "function foo is not supported; known are der, abs"),
    "wrong arguments": Mistake(drive(motor="J = sqrt(1, 2)"), 3, "motor.J", "sqrt is not defined for these arguments"),
    "ring": Mistake(drive("parameter Real a = b;\n parameter Real b = c + 1;\n parameter Real c = a;", motor="J = a"),
                    7, "c", "its value depends on itself: a -> b -> c -> a"),
    "ring of constants": Mistake("package P\n constant Real a = b;\n constant Real b = a;\nend P;\n"
                                 + drive(motor="J = P.a"),
                                 7, "motor.J", "b is not a number, and not a constant with a value"),
    "negative": Mistake(drive(motor="J = -1"), 3, "motor", "its J (inertia) is -1: it must be greater than zero"),
    "no ratio": Mistake(drive(f"parameter Real r = 0; {COMPONENTS}.IdealGear g(ratio = 1/r);"),
                        5, "g", "must be finite"),
    "unit": Mistake(drive("parameter Modelica.Units.SI.RotationalSpringConstant k = 2;", motor="J = k"), 3, "motor",
                    "its J (inertia) is in kg m^2, but k is in N m/rad"),
    "no unit": Mistake(drive('parameter Real x(unit = "furlong") = 1;', motor="J = x"), 5, "x", "furlong"),
    "division by zero": Mistake(drive(motor="J = 1/0"), 3, "motor.J", "a division by zero"),
    "too large": Mistake(drive(motor="J = 1e999999999"), 3, "motor.J", "a number is too large to calculate with"),
    "too small": Mistake(drive(motor="J = 1e-999999999"), 3, "motor", "its J (inertia) is 0"),
    "too large a power": Mistake(drive(motor="J = 10^(10^10)"), 3, "motor.J", "this power cannot be"),
    "too long a sum": Mistake(drive("parameter Real a = 1;", motor="J = ((a + 1)^8)^8"),
                              3, "motor.J", "this power cannot be"),
    "too long a number": Mistake(drive(motor="J = (((10^12)^12)^12)^12"), 3, "motor.J", "this power cannot be"),
    "imaginary": Mistake(drive(motor="J = (-1)^0.5"), 3, "motor.J", "this power cannot be"),
    "text": Mistake(drive('parameter String s = "a";', motor="J = s"),
                    3, "motor.J", "s is of type String, not a number"),
    "literal text": Mistake(drive(motor='J = "one"'), 3, "motor.J", '"one" is not a number'),
    "array": Mistake(drive(motor="J = {1, 2}"), 3, "motor.J", "arrays are not supported"),
    "element": Mistake(drive("parameter Real a = 1;", motor="J = a[1]"), 3, "motor", "arrays are not supported"),
    "if": Mistake(drive(motor="J = if true then 1 else 2"), 3, "", "an if-expression is not supported"),
    "variable": Mistake(drive("parameter Real x = motor.w;", motor="J = x"),
                        5, "x", "cannot depend on a variable: motor.w"),
    "constant without a value": Mistake(drive("constant Real c;", motor="J = c"),
                                        5, "c", "a constant needs a value"),
    "parameter of a package": Mistake("package P\n parameter Real a = 1;\nend P;\n" + drive(motor="J = P.a"),
                                      6, "motor.J",
                                      "P.a is not a number, and not a constant with a value"),
    "condition": Mistake(drive(f"parameter Boolean b; {COMPONENTS}.Inertia i if b;"),
                         5, "i", "a component with a condition is not supported"),
    }  # fmt: skip

EQUATIONS = {
    "value of a variable": Mistake(drive("Modelica.Blocks.Math.Gain g(k = 3, u = u); input Real u;"), 5, "g",
                                   "u is a variable: write its value as an equation"),
    "unknown component": Mistake(drive("", "connect(arm.flange_a, motor.flange_a);"), 9, "",
                                 "D has no arm; there is torque, motor, encoder"),
    "unknown connector": Mistake(drive("", "connect(motor.flange_c, motor.flange_a);"), 9, "",
                                 "no flange_c: did you mean flange_b or flange_a?; there is flange_a, flange_b"),
    "component": Mistake(drive("", "connect(motor, encoder.flange);"), 9, "",
                         "motor is of class Inertia, not a connector: connect motor.flange_a or motor.flange_b"),
    "parameter": Mistake(drive("", "connect(motor.J, torque.tau);"),
                         9, "", "motor.J is a parameter, not a connector"),
    "flange and signal": Mistake(drive("", "connect(motor.flange_a, torque.tau);"), 9, "",
                                 "motor.flange_a is a flange and torque.tau is a signal: they cannot be connected"),
    "too deep": Mistake(f"model A {COMPONENTS}.Inertia m(J = 1); end A;\n"
                        + drive("A a;", "connect(a.m.flange_a, motor.flange_a);"),
                        10, "", "a.m.flange_a is too deep inside: connect a connector of a itself"),
    "other connector": Mistake("connector F Real x; flow Real y; end F;\n"
                               + drive("F f;", "connect(f, motor.flange_a);"),
                               10, "",
                               "f cannot be connected: a flange must have an angle phi and a flow tau"),
    "in a sub-model": Mistake("model A\n equation\n connect(b, c);\nend A;\n" + drive("A a;"),
                              3, "", "A has no b"),
    "element": Mistake(drive("", "connect(motor.flange_a[1], motor.flange_b);"), 9, "", "arrays are not supported"),
    "for": Mistake(drive("", "for i in 1:3 loop\n connect(motor.flange_a, motor.flange_b);\n end for;"), 9, "",
                   "a for-loop is not supported: write linear equations and connect(...) one by one"),
    "if": Mistake(drive("Real x;", "if true then\n x = 1;\n else x = 2;\n end if;"),
                  9, "", "an if-equation is not"),
    "when": Mistake(drive("Real x;", "when true then\n x = 1;\n end when;"),
                    9, "", "a when-equation is not supported"),
    "assert": Mistake(drive("", 'assert(true, "fine");'), 9, "", "a function call as an equation is not supported"),
    "product": Mistake(drive("Real x = motor.w*motor.w;"), 5, "x", '"*" of variables: equations must be linear'),
    "quotient": Mistake(drive("Real x;", "x = 1/motor.w;"), 9, "", '"/" of variables: equations must be linear'),
    "sine": Mistake(drive("Real x = sin(motor.phi);"),
                    5, "x", "sin of a variable: equations must be linear, and gravity is"),
    "time": Mistake(drive("Real x = time;"), 5, "x", "equations cannot depend on time"),
    "derivative of the torque": Mistake(drive("Real x = der(u); input Real u;", "torque.tau = u;"),
                                        5, "x", "the derivative of u, a measured signal, is not known"),
    "too many": Mistake(drive("Real x = 1;", "x = 2;"),
                        1, "D", "14 equations for 13 variables: there are too many"),
    "too few": Mistake(drive("Real x; Real y;", "x = y;"),
                       1, "D", "13 equations for 14 variables: one or more are missing"),
    "in no equation": Mistake(drive("Real x;"), 5, "x", "x occurs in no equation"),
    "Boolean": Mistake(drive("Boolean b;"), 5, "b", "a variable of type Boolean is not supported"),
    "two torques": Mistake(drive(f"{ROTATIONAL}.Sources.Torque t2;", "connect(t2.flange, motor.flange_a);"),
                           5, "t2",
                           "torque.tau and t2.tau would both be the measured motor torque"),
    "two drivers": Mistake(drive("Modelica.Blocks.Sources.Step s;\n Modelica.Blocks.Sources.Step t;",
                                 "connect(s.y, torque.tau); connect(t.y, torque.tau);"),
                                 6, "t", "each of them sets the signal"),
    "open gain": Mistake(drive("Modelica.Blocks.Math.Gain g(k = 1);", "connect(g.y, torque.tau);"), 5, "g",
                         "nothing is connected to g.u"),
}  # fmt: skip


TABLES = {
    "syntax": SYNTAX,
    "classes": CLASSES,
    "modifications": MODIFICATIONS,
    "values": VALUES,
    "equations": EQUATIONS,
}


@pytest.mark.parametrize(("table", "name"), [(table, name) for table in TABLES for name in TABLES[table]])
def test_a_mistake_is_told_with_its_place(table: str, name: str) -> None:
    mistake = TABLES[table][name]
    with pytest.raises(ModelError) as error:
        flat(mistake.text)
    assert mistake.problem in error.value.problem
    where = error.value.origin
    assert (where.file, where.line, where.component) == ("d.mo", mistake.line, mistake.component)


def test_the_file_of_several_is_named() -> None:
    arm = Source("arm.mo", f"model Arm\n {COMPONENTS}.Inertia mass(J = nothing);\nend Arm;")
    with pytest.raises(ModelError, match=r"^arm\.mo:2: mass: nothing is not known in Arm$"):
        read([Source("d.mo", drive("Arm arm;")), arm])


@pytest.mark.parametrize("motor", ["J = " + "(" * 400 + "1" + ")" * 400, "J = " + "+".join(["1"] * 2000)])
def test_what_is_nested_without_end_is_no_traceback(motor: str) -> None:
    with pytest.raises(ModelError, match="nested too deeply"):
        flat(drive(motor=motor))
