"""Modifications: what brackets and values change, the outer over the inner."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.syntax import ClassDef, Expression, Modification

if TYPE_CHECKING:
    from monitor_core.modeling.modelica.instances import Instance


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
    """What becomes of one name: a value, and changes of what is inside of it."""

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
    """Both together; where both change the same, the outer one counts.

    Raises:
        ModelError: the inner one is final.
    """
    both = {name: merged(name, outer[name], inner[name]) for name in outer if name in inner}
    return {**inner, **outer, **both}


def merged(name: str, outer: Change, inner: Change, twice: bool = False) -> Change:
    """Two changes of one name; ``twice``: they stand in the same brackets.

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
