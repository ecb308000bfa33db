"""The meaning of a name in an expression: a component of the instance, or a constant around it or imported."""

from __future__ import annotations

from collections.abc import Iterator

from monitor_core.modeling.flat import ModelError
from monitor_core.modeling.modelica.instances import Instance, Scope
from monitor_core.modeling.modelica.names import Names, did_you_mean, outwards, similar
from monitor_core.modeling.modelica.syntax import ClassDef, Component, Name


def component(name: Name, scope: Scope) -> Instance | None:
    """The component of that name as seen from inside of the scope's instance; None: no component's name.

    Raises:
        ModelError: the first part is a component, the rest is not.
    """
    where = scope.instance
    for k, part in enumerate(name.parts):
        if part not in where.members:
            if k == 0 and part not in where.absent:
                return None
            near = did_you_mean(similar(part, where.members))
            absent = " under its condition" if part in where.absent else ""
            raise ModelError(f"{where.name} has no {part}{absent}{near}", scope.origin(name.line))
        where = where.members[part]
    return where


def constant_outside(name: Name, scope: Scope, names: Names) -> tuple[ClassDef, Component]:
    """The declaration of a name that is no component's: in a package around, imported, or named in full.

    Raises:
        ModelError: there is none.
    """
    for cls, last in _places(name, scope, names):
        for owner in _with_bases(cls, names):
            if last in owner.components:
                return owner, owner.components[last]
    origin = scope.origin(name.line)
    if name.parts == ("time",):
        raise ModelError("equations cannot depend on time", origin)
    near = did_you_mean(similar(str(name), scope.instance.members))
    raise ModelError(f"{name} is not known in {scope.cls.name}{near}", origin)


def _places(name: Name, scope: Scope, names: Names) -> Iterator[tuple[ClassDef, str]]:
    """Where a constant of that name may be declared: packages around, imports, a package named in full."""
    *package, last = name.parts
    if package:
        cls = names.search(scope.cls, tuple(package))
        if cls is not None:
            yield cls, last
        return
    for around in outwards(scope.cls):
        yield around, last
        for clause in around.imports:
            if clause.alias in (last, "*"):
                path = clause.path if clause.alias == "*" else clause.path[:-1]
                cls = names.search(names.root, path)
                if cls is not None:
                    yield cls, last if clause.alias == "*" else clause.path[-1]


def _with_bases(cls: ClassDef, names: Names, seen: tuple[ClassDef, ...] = ()) -> Iterator[ClassDef]:
    if cls not in seen:
        yield cls
        for _, base in names.bases(cls):
            yield from _with_bases(base, names, (*seen, cls))
