"""The library's names against the kinds of components that they stand for."""

from __future__ import annotations

import pytest

from monitor_core.modeling.components import KINDS, fragment
from monitor_core.modeling.components.units import parse as dimension
from monitor_core.modeling.flat import Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.declarations import parse
from monitor_core.modeling.modelica.instances import Instance
from monitor_core.modeling.modelica.instantiation import Instantiation
from monitor_core.modeling.modelica.names import Names, descendants, root_of
from monitor_core.modeling.modelica.standard_library import BEARING, LEAVES, REFUSED, SIGNAL_SOURCE
from monitor_core.modeling.modelica.syntax import Source

NAMES = Names(root_of([]))
OWN = {name: leaf for name, leaf in LEAVES.items() if leaf.kind not in (BEARING, SIGNAL_SOURCE)}


def instance(name: str) -> Instance:
    text = parse(Source("t.mo", f"model T {name} c; end T;"))
    names = Names(root_of([text]))
    found = names.search(names.root, ("T",))
    assert found is not None
    return Instantiation(names, lambda _: True).model(found).members["c"]


@pytest.mark.parametrize("name", OWN)
def test_same_variables(name: str) -> None:
    """What can be named in a text is what the component brings; accelerations of springs are not left out."""
    kind = KINDS[OWN[name].kind]
    parameters = {role.name: Laurent.symbol(role.name) for role in kind.roles}
    brought = {v.name for v in fragment(kind, "c", parameters, Origin()).variables}
    declared = {i.path for i in instance(name).tree() if i.base == "Real" and not i.is_parameter}
    assert declared == brought


@pytest.mark.parametrize("name", OWN)
def test_same_parameters(name: str) -> None:
    leaf, kind = OWN[name], KINDS[OWN[name].kind]
    assert {*leaf.roles, *leaf.fixed} == {role.name for role in kind.roles}
    members = instance(name).members
    assert set(leaf.roles.values()) <= set(members)
    for role, member in leaf.roles.items():
        attributes = members[member].attributes
        if kind.role(role).unit and kind.name != "gain":
            unit = attributes["unit"].value
            assert unit is not None
            text = getattr(unit.expression, "value", None)
            assert dimension(str(text)) == dimension(kind.role(role).unit)


@pytest.mark.parametrize("name", OWN)
def test_same_connectors(name: str) -> None:
    kind, members = KINDS[OWN[name].kind], instance(name).members
    assert {n for n, m in members.items() if m.is_flange} == set(kind.flanges)
    signals = {n: m.causality for n, m in members.items() if m.is_connector and not m.is_flange}
    assert signals == {**dict.fromkeys(kind.signals_in, "input"), **dict.fromkeys(kind.signals_out, "output")}


def test_every_refused_setting_exists_somewhere() -> None:
    declared = {name for leaf in LEAVES for name in instance(leaf).members}
    assert set(REFUSED) <= declared


def test_every_kind_of_component_has_a_name_but_viscous_friction() -> None:
    """Viscous friction is a BearingFriction, or a Damper to a Fixed."""
    assert set(KINDS) - {leaf.kind for leaf in OWN.values()} == {"viscous-friction"}


def test_all_units_of_the_librarys_types_can_be_read() -> None:
    types = [c for c in descendants(NAMES.root) if c.sort == "type"]
    assert len(types) > 50
    for each in types:
        text = getattr(each.extends[0].modifications[0].value, "value", None)
        dimension(str(text))
