"""The library's names against the kinds of components that they stand for."""

from __future__ import annotations

from functools import cache

import pytest
from pymoca import ast
from pymoca.tree import InstanceClass, flatten_class

from monitor_core.modeling.components import COMPONENT_KINDS, fragment
from monitor_core.modeling.components.units import parse as dimension
from monitor_core.modeling.flat import Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica import read
from monitor_core.modeling.modelica.classes import descendants, tree_of
from monitor_core.modeling.modelica.library import BEARING, LEAVES, REFUSED, SIGNAL_SOURCE, library
from monitor_core.modeling.modelica.parsing import Source, is_parameter, parse
from tests.core.modeling.modelica.texts import NESTED

OWN = {name: leaf for name, leaf in LEAVES.items() if leaf.kind not in (BEARING, SIGNAL_SOURCE)}


@cache
def component(name: str) -> InstanceClass:
    """A model with one component c of that class, flattened."""
    return flatten_class(tree_of([parse(Source("t.mo", f"model T {name} c; end T;"))]), "T")


@pytest.mark.parametrize("name", OWN)
def test_same_variables(name: str) -> None:
    """What can be named in a text is what the component brings; accelerations of springs are not left out."""
    kind = COMPONENT_KINDS[OWN[name].kind]
    parameters = {role.name: Laurent.symbol(role.name) for role in kind.roles}
    brought = {v.name for v in fragment(kind, "c", parameters, Origin()).variables}
    assert {n for n, s in component(name).symbols.items() if not is_parameter(s)} == brought


@pytest.mark.parametrize("name", OWN)
def test_same_parameters(name: str) -> None:
    leaf, kind = OWN[name], COMPONENT_KINDS[OWN[name].kind]
    assert {*leaf.roles, *leaf.fixed} == {role.name for role in kind.roles}
    symbols = component(name).symbols
    for role, member in leaf.roles.items():
        assert is_parameter(symbols[f"c.{member}"])
        if kind.role(role).unit and kind.name != "gain":
            assert dimension(str(symbols[f"c.{member}"].unit)) == dimension(kind.role(role).unit)


@pytest.mark.parametrize("name", OWN)
def test_same_connectors(name: str) -> None:
    kind, symbols = COMPONENT_KINDS[OWN[name].kind], component(name).symbols
    flows = {n.split(".")[1] for n, s in symbols.items() if "flow" in s.prefixes}
    assert flows == set(kind.flanges)
    assert {f"c.{end}" for end in (*kind.signals_in, *kind.signals_out)} <= set(symbols)


def test_reading_a_drive_leaves_the_library_as_it_is() -> None:
    """All drives share what its classes declare."""
    before = ast.Node.to_json(library())
    assert read([Source("d.mo", NESTED)]).sensors
    assert ast.Node.to_json(library()) == before


def test_every_refused_setting_exists_somewhere() -> None:
    declared = {n.split(".")[1] for leaf in LEAVES for n in component(leaf).symbols}
    assert set(REFUSED) <= declared


def test_every_kind_of_component_has_a_name_but_viscous_friction() -> None:
    """Viscous friction is a BearingFriction, or a Damper to a Fixed."""
    assert set(COMPONENT_KINDS) - {leaf.kind for leaf in OWN.values()} == {"viscous-friction"}


def test_all_units_of_the_librarys_types_can_be_read() -> None:
    types = [c for c in descendants(library()) if c.type == "type" and hasattr(c, "line")]
    assert len(types) > 50
    for each in types:
        (unit,) = each.extends[0].class_modification.arguments
        dimension(str(unit.value.modifications[0].value))
