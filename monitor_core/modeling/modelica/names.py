"""Checks all names in Modelica texts.

pymoca looks names up while it instantiates, and its errors have no lines.  The check here comes before: it finds
unknown classes, parameters and variables where they are written.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from pymoca import ast

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.classes import (
    BUILTIN,
    LIBRARY,
    MODELS,
    choice,
    descendants,
    look_up,
    meant,
    own_classes,
    similar,
)
from monitor_core.modeling.modelica.library import SOURCES
from monitor_core.modeling.modelica.parsing import is_parameter, place_of
from monitor_core.modeling.modelica.values import FUNCTIONS


def check_names(root: ast.Tree) -> None:
    """Check classes, modifications and the names in equations of all of the user's classes; drop pictures."""
    for cls in own_classes(root):
        cls.extends = [e for e in cls.extends if "Icons" not in e.component.to_tuple()]
        for extends in cls.extends:
            place = place_of(extends, cls.name)
            if not place.file:  # of "type Mass = Real(...)"
                place = place_of(cls, cls.name)
            base = _class(root, cls, extends.component, place)
            _check_modifications(base, extends.class_modification, place)
            for name in _members(base).keys() & cls.symbols.keys():
                problem = f"{name} is declared in {cls.name} and in its base class {base.name}"
                raise ModelError(problem, place_of(cls.symbols[name], name))
    for cls in own_classes(root):
        _check_bases(cls)
        _check_contents(cls, [cls], "")
        for symbol in cls.symbols.values():
            _check_component(root, cls, symbol)
        for equation in cls.equations:
            place = place_of(equation)
            ends = (equation.left, equation.right)
            if isinstance(equation, ast.ConnectClause):
                for end in ends:
                    _check_connector(cls, end, place)
            else:
                _check_variables(cls, ends, place)


def _check_bases(cls: ast.Class) -> None:
    path, where = [cls.full_name], cls
    while where.extends:
        where = look_up(where, where.extends[0].component)
        if not isinstance(where, ast.Class):
            return
        path.append(where.full_name)
        if where is cls:
            raise ModelError(f"{cls.name} extends itself: {' -> '.join(path)}", place_of(cls, cls.name))
        if where.full_name in path[:-1]:
            return


def _check_contents(cls: ast.Class, around: Sequence[ast.Class], path: str) -> None:
    for symbol in cls.symbols.values():
        found, name = look_up(cls, symbol.type), f"{path}{symbol.name}"
        if found in around:
            raise ModelError(f"{found.name} contains itself, as {name}", place_of(symbol, name))
        if isinstance(found, ast.Class) and place_of(found).file:
            _check_contents(found, [*around, found], f"{name}.")


def _check_component(root: ast.Tree, cls: ast.Class, symbol: ast.Symbol) -> None:
    place = place_of(symbol, symbol.name)
    found = _class(root, cls, symbol.type, place)
    if found.type in ("package", "function"):
        raise ModelError(f"{found.name} is a {found.type}, not the class of a component", place)
    if found.partial:
        raise ModelError(f"{found.name} is partial: use a model that extends it", place)
    if found.full_name.startswith(f"{SOURCES}."):
        symbol.class_modification = ast.ClassModification()  # any shape is the measured torque
    _check_modifications(found, symbol.class_modification, place, cls)


def _class(root: ast.Tree, cls: ast.Class, name: ast.ComponentRef, place: Origin) -> ast.Class:
    found = look_up(cls, name)
    if isinstance(found, ast.Class):
        return found
    *path, last = name.to_tuple()
    package = look_up(cls, ".".join(path)) if path else None
    of_library = name.to_tuple()[0] in LIBRARY
    problem = f"class {name} is not {'supported' if of_library else 'known'}"
    if isinstance(package, ast.Class) and package.classes:
        problem += choice(last, package.classes)
    else:
        known = [c for c in descendants(root) if c.type in (*MODELS, "connector")]
        near = similar(last, {c.name for c in known})
        problem += meant([c.full_name for n in near for c in known if c.name == n])
    raise ModelError(problem, place)


def _members(cls: ast.Class, deep: int = 20) -> dict[str, ast.Symbol]:
    """The components of a class, its own and inherited ones."""
    members: dict[str, ast.Symbol] = {}
    for extends in cls.extends if deep else ():
        base = look_up(cls, extends.component)
        if isinstance(base, ast.Class):
            members |= _members(base, deep - 1)
    return members | dict(cls.symbols)


def _is_simple(cls: ast.Class, deep: int = 20) -> bool:
    """Whether a class is a number, truth value, text or enumeration, whose modifications are attributes."""
    bases = [look_up(cls, e.component) for e in cls.extends] if deep else []
    inherited = any(isinstance(b, ast.Class) and _is_simple(b, deep - 1) for b in bases)
    return cls.name in BUILTIN or ast.is_enumeration(cls) or inherited


def _check_modifications(
    cls: ast.Class, changes: ast.ClassModification | None, place: Origin, scope: ast.Class | None = None
) -> None:
    """The names in brackets behind a component or a base class; ``scope``: where values are looked up."""
    seen: set[tuple[str, ...]] = set()
    for argument in changes.arguments if changes is not None else ():
        change = argument.value
        at = place if not hasattr(change, "line") else place_of(change, place.component)
        name = change.component.to_tuple()
        values = [m for m in change.modifications if not isinstance(m, ast.ClassModification)]
        if name in seen and values:
            raise ModelError(f"{'.'.join(name)} is given twice", at)
        seen |= {name} if values else set()
        inner, changed = _modified(cls, name, at)
        if values and changed is not None and changed.final:
            raise ModelError(f"{'.'.join(name)} is final and cannot be changed from outside", at)
        if values and changed is not None and not is_parameter(changed):
            # pymoca would look its value up inside of the component
            raise ModelError(f"{'.'.join(name)} is a variable: write its value as an equation", at)
        if values and scope is not None:
            _check_variables(scope, values, at)
        if values and inner is not None and not _is_simple(inner) and name == ("value",):
            raise ModelError(f"a value for all of {at.component} is not supported: give its parameters one by one", at)
        for modification in change.modifications:
            if isinstance(modification, ast.ClassModification) and inner is not None:
                _check_modifications(inner, modification, at, scope)


def _modified(cls: ast.Class, name: Sequence[str], place: Origin) -> tuple[ast.Class | None, ast.Symbol | None]:
    """The class and the symbol that a modification changes; None for an attribute of a number."""
    symbol: ast.Symbol | None = None
    for k, part in enumerate(name):
        if part == "value" and k == 0 and len(name) == 1:
            return cls, None
        if _is_simple(cls):
            if part not in (*ast.Symbol.ATTRIBUTES, "stateSelect"):
                near = meant(similar(part, ast.Symbol.ATTRIBUTES))
                raise ModelError(f"Real {'.'.join(name[:k]) or place.component} has no {part}{near}", place)
            return None, None
        members = _members(cls)
        if part not in members:
            raise ModelError(f"{cls.name} has no {part}{choice(part, members)}", place)
        symbol = members[part]
        found = look_up(symbol.parent or cls, symbol.type)
        if not isinstance(found, ast.Class):
            return None, symbol
        cls = found
    return cls, symbol


def _check_variables(cls: ast.Class, nodes: Iterable[Any], place: Origin) -> None:
    """Check that each name in expressions is a component or a constant."""
    for node in nodes:
        if isinstance(node, ast.Expression):
            _check_variables(cls, node.operands, place)
            if not isinstance(node.operator, str):
                _check_function(node.operator, place)
        elif isinstance(node, ast.Array):
            _check_variables(cls, node.values, place)
        elif isinstance(node, ast.ComponentRef) and node.name != "time":
            _check_variable(cls, node, place)


def _check_function(name: ast.ComponentRef, place: Origin) -> None:
    if str(name).removeprefix("Modelica.Math.") not in FUNCTIONS:
        known = ", ".join(sorted(FUNCTIONS))
        raise ModelError(f"function {name} is not supported; known are der, {known}", place)


def _check_variable(cls: ast.Class, name: ast.ComponentRef, place: Origin) -> None:
    if _has_subscripts(name):
        raise ModelError(f"{name}[..]: arrays are not supported", place)
    first, *rest = name.to_tuple()
    members = _members(cls)
    where: ast.Class | None = None
    if first in members:
        found: Any = members[first]
        for part in rest:
            where = look_up(found.parent or cls, found.type)
            inside = _members(where) if isinstance(where, ast.Class) else {}
            if part not in inside:
                raise ModelError(f"{found.name} has no {part}{choice(part, inside)}", place)
            found = inside[part]
    elif look_up(cls, name) is None:
        near = meant(similar(first, members)) if not rest else ""
        raise ModelError(f"{name} is not known in {cls.name}{near}", place)


def _check_connector(cls: ast.Class, end: ast.ComponentRef, place: Origin) -> None:
    """Check an end of connect(..): it must be a connector of the class, or of one of its components."""
    members, names = _members(cls), end.to_tuple()
    if len(names) > 2:
        raise ModelError(f"{end} is too deep inside: connect a connector of {names[0]} itself", place)
    where = cls
    for part in names:
        if part not in members:
            ends = [n for n, s in members.items() if _is_connector(s, where)]
            known = choice(part, ends or members)
            raise ModelError(f"{end} cannot be connected: {where.name} has no {part}{known}", place)
        symbol = members[part]
        found = look_up(symbol.parent or where, symbol.type)
        source = isinstance(where, ast.Class) and where.full_name.startswith(f"{SOURCES}.")
        members, outer = (_members(found), where) if isinstance(found, ast.Class) else ({}, where)
        where = found if isinstance(found, ast.Class) else where
    if _has_subscripts(end) and not source:
        raise ModelError(f"{end}[..]: arrays are not supported", place)
    if not _is_connector(symbol, outer):
        inside = [f"{end}.{n}" for n, s in members.items() if _is_connector(s, where)]
        instead = f": connect {' or '.join(inside)}" if inside else ""
        kind = "a parameter" if "parameter" in symbol.prefixes else f"of class {symbol.type.to_tuple()[-1]}"
        raise ModelError(f"{end} is {kind}, not a connector{instead}", place)


def _has_subscripts(name: ast.ComponentRef) -> bool:
    return any(i is not None for indices in name.indices for i in indices) or any(map(_has_subscripts, name.child))


def _is_connector(symbol: ast.Symbol, cls: ast.Class) -> bool:
    found = look_up(symbol.parent or cls, symbol.type)
    signal = bool({"input", "output"} & set(symbol.prefixes))
    return signal or (isinstance(found, ast.Class) and found.type == "connector")
