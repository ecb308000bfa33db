"""Mistakes in drawings and in tables of components: the component is named, and what would be right."""

from __future__ import annotations

from typing import Any

import pytest

from monitor_core.modeling.components import KINDS
from monitor_core.modeling.drawing import Drawing, Part, from_tables, part
from monitor_core.modeling.flat import ModelError, Origin
from tests.core.modeling.drawings import TABLES, two_mass


@pytest.mark.parametrize(
    ("number", "change", "problem"),
    [
        (
            1,
            {"type": "inertial"},
            "motor: unknown type 'inertial': did you mean \"inertia\"? there is inertia, fixed,",
        ),
        (1, {"type": "gain"}, "motor: unknown type 'gain': there is"),
        (1, {"type": None}, 'motor: its type is missing: write type = "inertia"'),
        (1, {"type": 3}, "motor: its type is 3, not a word"),
        (1, {"name": None}, 'component 2: its name is missing: write name = "motor"'),
        (1, {"name": "my motor"}, "my motor: the name 'my motor' is not made of letters, digits and _"),
        (1, {"at": None}, 'motor: at, where it is connected, is missing: write at = "shaft"'),
        (3, {"at": None}, 'belt: at, where it is connected, is missing: write at = ["shaft", "load"]'),
        (3, {"at": [1, 2]}, "belt: at, where it is connected, is [1, 2]"),
        (3, {"at": "shaft"}, "belt: it is at shaft, but the type spring-damper is at two nodes"),
        (3, {"at": ["shaft", "shaft"]}, "belt: both ends are at the node 'shaft': it joins two different nodes"),
        (3, {"at": ["shaft", ""]}, "belt: a node has an empty name"),
        (1, {"at": ["a", "b", "c"]}, "motor: it is at a, b, c, but the type inertia is at one node or two"),
        (5, {"at": ["a", "b"]}, "encoder: it is at a, b, but the type speed-sensor is at one node"),
        (5, {"at": []}, "encoder: it is at none, but"),
        (1, {"j": "Jm"}, "motor: unknown key 'j': did you mean \"J\"? there is type, name, at, J"),
        (1, {"inertia": 1}, "motor: unknown key 'inertia'"),
        (1, {"J": True}, 'motor: its J is True: write a name ("Jm")'),
        (1, {"J": "Jm +"}, "motor: 'Jm +' is not an expression such as"),
        (1, {"J": -0.1}, "motor: its J (inertia) is -0.1: it must be greater than zero"),
        (1, {"J": "-0.1"}, "motor: its J (inertia) is -0.1: it must be greater than zero"),
        (1, {"J": 0}, "motor: its J (inertia) is 0: it must be greater than zero"),
        (1, {"J": float("nan")}, "motor: its J (inertia) is nan: it must be finite"),
        (3, {"d": float("inf")}, "belt: its d (damping) is inf: it must be finite"),
        (4, {"name": "motor"}, "motor: 2 components are called 'motor': each needs a name of its own"),
    ],
)  # fmt: skip
def test_mistakes_in_tables_name_the_component(number: int, change: dict[str, Any], problem: str) -> None:
    tables = [dict(t) for t in TABLES]
    tables[number] = {k: v for k, v in {**tables[number], **change}.items() if v is not None}
    origins = [Origin("", "demo.toml", 20 + i) for i in range(len(tables))]
    with pytest.raises(ModelError) as caught:
        from_tables("two-mass", tables, origins).flat()
    assert str(caught.value).startswith(f"demo.toml:{20 + number}: {problem}")


def test_a_spring_constant_given_to_an_inertia_names_both() -> None:
    tables = [{**t, "J": "k"} if t["name"] == "motor" else t for t in TABLES]
    with pytest.raises(ModelError) as caught:
        from_tables("two-mass", tables, [Origin("", "demo.toml", i) for i in range(len(tables))]).flat()
    message = "its c (stiffness) is in N m/rad, but k is in kg m^2 (k is kg m^2: J (inertia) of motor)"
    assert str(caught.value) == f"demo.toml:3: belt: {message}"


@pytest.mark.parametrize(
    ("nominal", "problem"),
    [
        (
            {"Jmm": 1.0},
            "nominal value of 'Jmm', which is no parameter: did you mean \"Jm\"? there is kT, Jm, fm, k, d, Ja",
        ),
        ({"Jm": -1.0}, "motor: nominal value of Jm (inertia of the motor) is -1: it must be greater than zero"),
        ({"kT": 0.0}, "torque: nominal value of kT (torque constant of the torque) is 0: it must be greater than"),
        (
            {"fm": float("nan")},
            "bearing: nominal value of fm (viscous friction of the bearing) is nan: it must be finite",
        ),
        ({"fm": "a"}, "bearing: nominal value of fm (viscous friction of the bearing) is 'a': it must be finite"),
    ],
)  # fmt: skip
def test_mistakes_in_nominal_values(nominal: dict[str, Any], problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        two_mass(**nominal).flat()
    assert str(caught.value).startswith(problem)


@pytest.mark.parametrize(
    ("J", "nominal", "problem"),
    [
        (
            "a - b",
            {"a": 1.0, "b": 2.0},
            "its J (inertia) = a - b is -1 at the nominal values: it must be greater than",
        ),
        ("-a", {"a": 1.0}, "its J (inertia) = -a is -1 at the nominal values"),
        ("1/a + b", {"a": 0.0, "b": 2.0}, "is inf at the nominal values: it must be finite"),
        ("a^12", {"a": 1e300}, "is inf at the nominal values: it must be finite"),
    ],
)
def test_expressions_are_checked_where_all_values_are_known(
    J: str, nominal: dict[str, float], problem: str
) -> None:
    with pytest.raises(ModelError) as caught:
        Drawing("arm", [part("inertia", "arm", "arm", J=J)], nominal).flat()
    assert problem in str(caught.value)
    assert caught.value.origin.component == "arm"
    some = dict(list(nominal.items())[1:])
    Drawing("arm", [part("inertia", "arm", "arm", J=J)], some).flat()


@pytest.mark.parametrize(
    ("parts", "more", "problem"),
    [
        ([], {}, "the drive has no components"),
        ([part("fixed", "a", "n"), part("fixed", "b", "n")], {}, "the node 'n' is fixed already"),
        ([part("inertia", "ground", "ground")], {}, "2 components are called 'ground'"),
        (
            [part("inertia", "arm", "a")],
            {"meanings": {"J": "x"}},
            "meaning of 'J', which is no parameter: there is arm.J",
        ),
        ([part("damper", "d", "a", "b", d="J"), part("inertia", "arm", "a", J="J")], {}, "but J is in N m s/rad"),
    ],
)  # fmt: skip
def test_mistakes_in_drawings(parts: list[Part], more: dict[str, Any], problem: str) -> None:
    with pytest.raises(ModelError) as caught:
        Drawing("arm", parts, **more).flat()
    assert problem in str(caught.value)


def test_an_unknown_parameter_of_a_component() -> None:
    arm = Part(KINDS["inertia"], "arm", ("a",), {"j": "Ja"}, Origin("arm"))
    with pytest.raises(ModelError, match="inertia has no parameter 'j': did you mean \"J\"\\? there is J"):
        Drawing("arm", [arm]).flat()
