"""From classes to the tree of instances: a drive with its components, theirs, and so on down to single quantities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from monitor_core.modeling.components.units import parse
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.standard_library import Leaf
from monitor_core.modeling.modelica.syntax import (
    ClassDef,
    Component,
    Expression,
    Literal,
    Modification,
    Statement,
)


@dataclass(slots=True, eq=False)
class Instance:
    """A component (or the whole model, whose path is "") with everything in it.

    ``base``: "Real", ... of a single quantity, otherwise "".  ``leaf``: the library component that it is or extends, if
    any. ``absent``: components switched off by their condition.  ``statements``: each with the class it belongs to.
    """

    path: str
    cls: ClassDef
    origin: Origin
    parent: Instance | None = None
    declaration: Component | None = None
    base: str = ""
    leaf: Leaf | None = None
    causality: str = ""
    variability: str = ""
    final: bool = False
    binding: Bound | None = None
    attributes: Changes = field(default_factory=dict)
    members: dict[str, Instance] = field(default_factory=dict)
    absent: set[str] = field(default_factory=set)
    statements: list[tuple[Statement, Scope]] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Its path; the model's name for the model itself."""
        return self.path or self.cls.name

    def inside(self, member: str) -> str:
        """The path of a member."""
        return f"{self.path}.{member}" if self.path else member

    def tree(self) -> Iterator[Instance]:
        """Itself and everything inside, as declared."""
        yield self
        for member in self.members.values():
            yield from member.tree()

    @property
    def is_connector(self) -> bool:
        """A flange or a signal that can be connected."""
        return self.cls.sort == "connector"

    @property
    def is_flange(self) -> bool:
        """A connector with an angle and a torque."""
        return self.is_connector and not self.base

    @property
    def is_parameter(self) -> bool:
        """A parameter or a constant."""
        return bool(self.variability)


def unit_of(instance: Instance) -> str:
    """The unit that the type or a modification gives, as units.py writes it; "" if none.

    Raises:
        ModelError: it cannot be read.
    """
    change = instance.attributes.get("unit")
    value = change.value.expression if change is not None and change.value is not None else None
    if not isinstance(value, Literal) or not isinstance(value.value, str) or not value.value:
        return ""
    return str(parse(value.value, instance.origin))


# --- Errors in a user's text that name the component ------------------------------------------------------------------


@contextmanager
def about(component: str) -> Iterator[None]:
    """Adds the component to an error from inside that names none, or one that contains this one."""
    try:
        yield
    except ModelError as error:
        named = error.origin.component
        if named and not component.startswith(f"{named}."):
            raise
        raise ModelError(error.problem, replace(error.origin, component=component)) from None


# --- Modifications: what brackets and values change, the outer over the inner -----------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Scope:
    """Where the names of an expression are looked up: in an instance, then around the class it was written in."""

    instance: Instance
    cls: ClassDef

    def origin(self, line: int, component: str | None = None) -> Origin:
        """A line of the class's file; the component is the instance, unless another is given."""
        name = self.instance.path if component is None else component
        return Origin(name, self.cls.file, line) if self.cls.file else self.instance.origin


@dataclass(frozen=True, slots=True)
class Bound:
    """An expression with the scope that it was written in."""

    expression: Expression
    scope: Scope

    @property
    def origin(self) -> Origin:
        """Where it was written."""
        return self.scope.origin(self.expression.line)


@dataclass(frozen=True, slots=True)
class Change:
    """The modification of a name: a value, and changes of its members."""

    origin: Origin
    value: Bound | None = None
    inner: Mapping[str, Change] = field(default_factory=dict)
    final: bool = False


Changes = Mapping[str, Change]


def changes_of(modifications: Iterable[Modification], scope: Scope) -> dict[str, Change]:
    """The changes that brackets in that scope make.

    Raises:
        ModelError: ``redeclare``; a name twice.
    """
    changes: dict[str, Change] = {}
    for modification in modifications:
        origin = scope.origin(modification.line)
        if modification.refused:
            raise ModelError(
                f'"{modification.refused}" is not supported: write the model with the class that is wanted',
                origin,
            )
        first, change = _change(modification, scope, origin)
        if first in changes:
            change = merged(first, change, changes[first], twice=True)
        changes[first] = change
    return changes


def _change(modification: Modification, scope: Scope, origin: Origin) -> tuple[str, Change]:
    value = Bound(modification.value, scope) if modification.value is not None else None
    change = Change(origin, value, changes_of(modification.inner, scope), modification.final)
    for name in reversed(modification.name[1:]):
        change = Change(origin, inner={name: change})
    return modification.name[0], change


def overlaid(outer: Changes, inner: Changes) -> dict[str, Change]:
    """Both modifications together; where both change the same, the outer one counts.

    Raises:
        ModelError: the inner one is final.
    """
    both = {name: merged(name, outer[name], inner[name]) for name in outer if name in inner}
    return {**inner, **outer, **both}


def merged(name: str, outer: Change, inner: Change, twice: bool = False) -> Change:
    """Two changes of one name; ``twice``: they are in the same brackets.

    Raises:
        ModelError: the inner one is final; a value is given twice in the same brackets.
    """
    if outer.value is not None and inner.value is not None:
        if twice:
            raise ModelError(f"{name} is given twice", outer.origin)
        if inner.final:
            where = f" (line {inner.origin.line})" if inner.origin.line else ""
            raise ModelError(f"{name} is final{where} and cannot be changed from outside", outer.origin)
    value = outer.value if outer.value is not None else inner.value
    final = outer.final if outer.value is not None else inner.final
    return replace(outer, value=value, inner=overlaid(outer.inner, inner.inner), final=final)
