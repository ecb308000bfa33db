"""Builds the tree of instances: base classes, modifications, conditions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NoReturn

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.instances import (
    Bound,
    Change,
    Changes,
    Instance,
    Scope,
    about,
    changes_of,
    merged,
    overlaid,
)
from monitor_core.modeling.modelica.names import Names, did_you_mean, listed, similar
from monitor_core.modeling.modelica.standard_library import LEAVES, SIGNAL_SOURCE
from monitor_core.modeling.modelica.syntax import ClassDef, Component

ATTRIBUTES = (
    *("start", "fixed", "min", "max", "unit", "displayUnit", "quantity", "nominal", "stateSelect"),
    "unbounded",
)
"""What can be modified of a Real; only ``unit`` matters here."""

_INSTEAD = {
    "array": "arrays are not supported: declare the components one by one",
    "inner": '"inner" and "outer" are not supported: connect the components instead',
    "outer": '"inner" and "outer" are not supported: connect the components instead',
    "replaceable": '"replaceable" is not supported: write the model with the class that is wanted',
    "redeclare": '"redeclare" is not supported: write the model with the class that is wanted',
}


@dataclass
class _Elements:
    """What a class and its bases declare: component -> where it was declared, and the changes on the way."""

    found: dict[str, tuple[Component, Scope, Changes]] = field(default_factory=dict)
    bases: list[ClassDef] = field(default_factory=list)


class Instantiation:
    """Instantiates classes.

    Args:
        names: where classes are looked up.
        truth: says whether a condition holds.
    """

    def __init__(self, names: Names, truth: Callable[[Bound], bool]) -> None:
        self.names, self.truth = names, truth

    def model(self, cls: ClassDef) -> Instance:
        """The whole of a model.

        Raises:
            ModelError: whatever is wrong with it.
        """
        origin = Origin(cls.name, cls.file, cls.line)
        if cls.partial:
            raise ModelError(
                f"{cls.sort} {cls.name} is partial: only a model that extends it can be read", origin
            )
        model = Instance("", cls, origin)
        self._fill(model, {})
        return model

    # --- one instance ----------------------------------------------------------------------------------

    def _fill(self, new: Instance, changes: Changes) -> None:
        elements = _Elements()
        self._collect(new, new.cls, changes, elements, ())
        if new.base:
            return
        if new.leaf is None or new.leaf.kind != SIGNAL_SOURCE:
            _check_names(new, changes, elements)
        parameters_first = sorted(elements.found.items(), key=lambda item: not item[1][0].variability)
        for name, (component, scope, around) in parameters_first:
            self._add(new, name, component, scope, around)
        new.members = {name: new.members[name] for name in elements.found if name in new.members}

    def _collect(
        self, new: Instance, cls: ClassDef, changes: Changes, elements: _Elements, chain: tuple[ClassDef, ...]
    ) -> None:
        """Base classes first; ``changes``: what is modified from outside of ``cls``."""
        if cls in chain:
            loop = " -> ".join(c.name for c in (*chain[chain.index(cls) :], cls))
            raise ModelError(f"{cls.name} extends itself: {loop}", Origin(cls.name, cls.file, cls.line))
        _check_supported(cls, new)
        elements.bases.append(cls)
        if cls.sort == "predefined":
            _become_quantity(new, cls.name, changes)
        if cls.sort == "enumeration":
            new.base = "enumeration"
        if str(cls) in LEAVES:
            new.leaf = LEAVES[str(cls)]
        new.causality = new.causality or cls.prefix
        scope = Scope(new, cls)
        for extends, base in self.names.bases(cls):
            inner = changes_of(extends.modifications, scope)
            self._collect(new, base, overlaid(changes, inner), elements, (*chain, cls))
        for component in cls.components.values():
            _declare(elements, component, scope, changes)
        new.statements.extend((statement, scope) for statement in cls.statements)

    # --- its components --------------------------------------------------------------------------------

    def _add(self, owner: Instance, name: str, component: Component, scope: Scope, around: Changes) -> None:
        path = owner.inside(name)
        with about(path):
            change = _own(component, scope)
            if name in around:
                change = merged(name, around[name], change)
            if component.condition is not None and not self.truth(Bound(component.condition, scope)):
                owner.absent.add(name)
                return
        if component.refused and scope.cls.file:
            raise ModelError(_INSTEAD[component.refused], scope.origin(component.line, path))
        cls = self.names.find(scope.cls, component.type, scope.origin(component.type.line, path))
        new = Instance(path, cls, scope.origin(component.line, path), owner, component)
        _check_not_inside_itself(new)
        new.causality, new.variability = component.causality, component.variability
        new.binding, new.final = change.value, change.final
        with about(path):
            self._fill(new, change.inner)
        _check_component(new)
        owner.members[name] = new


def _own(component: Component, scope: Scope) -> Change:
    """What the declaration itself says."""
    value = Bound(component.value, scope) if component.value is not None else None
    inner = changes_of(component.modifications, scope)
    return Change(scope.origin(component.line), value, inner, component.final)


def _declare(elements: _Elements, component: Component, scope: Scope, changes: Changes) -> None:
    old = elements.found.get(component.name)
    if old is not None and old[0] is not component:
        where = f"{old[1].cls.name} and {scope.cls.name}"
        raise ModelError(f"{component.name} is declared in {where}", scope.origin(component.line))
    elements.found[component.name] = (component, scope, changes)


def _become_quantity(new: Instance, base: str, changes: Changes) -> None:
    new.base, new.attributes = base, changes
    for name, change in changes.items():
        if name not in ATTRIBUTES:
            problem = f"{base} {new.name} has no {name}{did_you_mean(similar(name, ATTRIBUTES))}"
            raise ModelError(problem, replace(change.origin, component=new.name))


# --- checks ----------------------------------------------------------------------------------------------


def _check_supported(cls: ClassDef, new: Instance) -> None:
    for refused in cls.refused:
        raise ModelError(
            f"{refused.what} in {cls.sort} {cls.name} is not supported: write its linear equations out",
            Origin(new.name, cls.file, refused.line),
        )
    if cls.sort in ("function", "operator", "operatorfunction", "purefunction", "impurefunction"):
        raise ModelError(f"{cls.name} is a {cls.sort}, not a component", new.origin)


def _check_names(new: Instance, changes: Changes, elements: _Elements) -> None:
    """Everything that is modified, from outside or by ``extends``, exists."""
    around: Mapping[str, Change] = {}
    for _, _, more in elements.found.values():
        around = {**around, **more}
    for name, change in {**around, **changes}.items():
        if name not in elements.found:
            problem = f"{new.cls.name} has no {name}{did_you_mean(similar(name, elements.found))}"
            known = listed(elements.found, "; there is")
            raise ModelError(problem + known, replace(change.origin, component=new.name))


def _check_not_inside_itself(new: Instance) -> None:
    around = new.parent
    while around is not None:
        if around.cls is new.cls:
            raise ModelError(f"{new.cls.name} contains itself, as {new.path}", new.origin)
        around = around.parent


def _check_component(new: Instance) -> None:
    declaration = new.declaration
    assert declaration is not None
    if new.base and new.cls.sort in _CLASSES:
        _wrong_sort(new)
    if new.cls.sort == "package":
        _wrong_sort(new)
    if new.binding is not None and not new.base:
        raise ModelError(
            f"a value for all of {new.path} is not supported: give its parameters one by one, in brackets",
            replace(new.binding.origin, component=new.path),
        )
    if new.cls.partial and not new.base:
        raise ModelError(f"{new.cls.name} is partial: use a model that extends it", new.origin)


_CLASSES = ("model", "block")


def _wrong_sort(new: Instance) -> NoReturn:
    raise ModelError(f"{new.cls.name} is a {new.cls.sort}, not the class of a component", new.origin)
