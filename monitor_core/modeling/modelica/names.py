"""Names of a Modelica text: the tree of all classes, the class that is the drive, and a check of every name.

pymoca looks names up while it instantiates, and its errors have no lines.  The check here comes before: it finds
unknown classes, parameters and variables where they are written.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar

from pymoca import ast
from pymoca.parser import ModelicaFile
from pymoca.tree import NameLookupError, find_name

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.library import SOURCES, library
from monitor_core.modeling.modelica.parsing import Source, is_parameter, place_of
from monitor_core.modeling.modelica.values import FUNCTIONS

ClassT = TypeVar("ClassT", bound=ast.Class)

_LIBRARY = ("Modelica", "AxisWatch")
_MODELS = ("model", "block", "class")
_BUILTIN = ("Real", "Integer", "Boolean", "String")


def tree_of(files: Sequence[ModelicaFile]) -> ast.Tree:
    """The library and the classes of the texts; a text's own Modelica or AxisWatch package is ignored.

    Raises:
        ModelError: a class is defined twice.
    """
    root = _copy(library())
    for file in sorted(files, key=lambda f: len(f.within)):
        path: tuple[str, ...] = file.within[0].to_tuple() if file.within else ()
        if path[:1] and path[0] in _LIBRARY:
            continue
        package: ast.Class = root
        for name in path:
            package = package.classes.setdefault(name, ast.Class(name=name, type="package"))
        for name, new in file.classes.items():
            if path or name not in _LIBRARY:
                _add(package, new)
    root.update_parent_refs()
    return root


def _copy(package: ClassT) -> ClassT:
    """With classes of its own at any depth; what they declare is only read, and shared: to copy all takes too long."""
    new = copy.copy(package)
    new.classes = {name: _copy(inner) for name, inner in package.classes.items()}
    return new


def _add(package: ast.Class, new: ast.Class) -> None:
    old = package.classes.get(new.name)
    if old is not None and hasattr(old, "line"):
        where = f"in {old.file}, line {old.line}" if old.file else "in the library"
        raise ModelError(f"{new.type} {new.name} exists already {where}", place_of(new))
    if old is not None:  # a package that only a text within it has named so far
        new.classes.update(old.classes)
    package.classes[new.name] = new


def own_classes(cls: ast.Class) -> list[ast.Class]:
    """The user's classes inside, at any depth."""
    return [inner for inner in descendants(cls) if getattr(inner, "file", "")]


# --- the drive -------------------------------------------------------------------------------------------


def choose(root: ast.Tree, sources: Sequence[Source], model: str | None) -> ast.Class:
    """The class of that name, otherwise the only model that no other class of the texts uses or extends.

    Raises:
        ModelError: there is none, or several.
    """
    classes = own_classes(root)
    models = [c for c in classes if c.type in _MODELS]
    if not models:
        empty = all(not source.text.strip() for source in sources)
        problem = "the text is empty" if empty else 'there is no model in it: "model Name ... end Name;"'
        raise ModelError(problem, Origin(file=", ".join(source.name for source in sources)))
    chosen = _only(models, classes) if model is None else _named(root, model, models)
    if chosen.partial:
        problem = f"model {chosen.name} is partial: only a model that extends it can be read"
        raise ModelError(problem, place_of(chosen, chosen.name))
    return chosen


def _named(root: ast.Tree, model: str, models: Sequence[ast.Class]) -> ast.Class:
    found = _found(root, model)
    same = [found] if isinstance(found, ast.Class) else [c for c in models if c.name == model]
    if len(same) != 1 or same[0] not in models:
        last = similar(model.split(".")[-1], {c.name for c in models})
        near = meant([c.full_name for c in models if c.name in last])
        known = ", ".join(c.full_name for c in models)
        raise ModelError(f"there is no model {model}{near}; there is {known}", Origin(file=models[0].file))
    return same[0]


def _only(models: Sequence[ast.Class], classes: Sequence[ast.Class]) -> ast.Class:
    used = {id(other) for c in classes for other in _used_by(c)}
    free = [c for c in models if id(c) not in used and not c.partial]
    if len(free) == 1:
        return free[0]
    if len(models) == 1:
        return models[0]
    names = ", ".join(c.full_name for c in free or models)
    if free:
        problem = f"several models could be the drive; say which: {names}"
    else:
        problem = f"every model is partial, or used by another one; say which is the drive: there is {names}"
    raise ModelError(problem, Origin(file=models[0].file))


def _used_by(cls: ast.Class) -> Iterator[ast.Class]:
    for name in (*(s.type for s in cls.symbols.values()), *(e.component for e in cls.extends)):
        found = _found(cls, name)
        if isinstance(found, ast.Class) and found is not cls:
            yield found


# --- the check -------------------------------------------------------------------------------------------


def check_names(root: ast.Tree) -> None:
    """Check classes, modifications and the names in equations of all of the user's classes; drop pictures.

    Raises:
        ModelError: one is not known, or is not of the right sort.
    """
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
        where = _found(where, where.extends[0].component)
        if not isinstance(where, ast.Class):
            return
        path.append(where.full_name)
        if where is cls:
            raise ModelError(f"{cls.name} extends itself: {' -> '.join(path)}", place_of(cls, cls.name))
        if where.full_name in path[:-1]:
            return


def _check_contents(cls: ast.Class, around: Sequence[ast.Class], path: str) -> None:
    for symbol in cls.symbols.values():
        found, name = _found(cls, symbol.type), f"{path}{symbol.name}"
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
    found = _found(cls, name)
    if isinstance(found, ast.Class):
        return found
    *path, last = name.to_tuple()
    package = _found(cls, ".".join(path)) if path else None
    of_library = name.to_tuple()[0] in _LIBRARY
    problem = f"class {name} is not {'supported' if of_library else 'known'}"
    if isinstance(package, ast.Class) and package.classes:
        problem += choice(last, package.classes)
    else:
        known = [c for c in descendants(root) if c.type in (*_MODELS, "connector")]
        near = similar(last, {c.name for c in known})
        problem += meant([c.full_name for n in near for c in known if c.name == n])
    raise ModelError(problem, place)


def descendants(cls: ast.Class) -> Iterator[ast.Class]:
    """All classes inside, at any depth."""
    for inner in cls.classes.values():
        yield inner
        yield from descendants(inner)


def _members(cls: ast.Class, deep: int = 20) -> dict[str, ast.Symbol]:
    """The components of a class, its own and inherited ones."""
    members: dict[str, ast.Symbol] = {}
    for extends in cls.extends if deep else ():
        base = _found(cls, extends.component)
        if isinstance(base, ast.Class):
            members |= _members(base, deep - 1)
    return members | dict(cls.symbols)


def _is_simple(cls: ast.Class, deep: int = 20) -> bool:
    """A number, truth value, text or enumeration: what is in brackets are its attributes."""
    bases = [_found(cls, e.component) for e in cls.extends] if deep else []
    inherited = any(isinstance(b, ast.Class) and _is_simple(b, deep - 1) for b in bases)
    return cls.name in _BUILTIN or ast.is_enumeration(cls) or inherited


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
            raise ModelError(
                f"a value for all of {at.component} is not supported: give its parameters one by one", at
            )
        for modification in change.modifications:
            if isinstance(modification, ast.ClassModification) and inner is not None:
                _check_modifications(inner, modification, at, scope)


def _modified(
    cls: ast.Class, name: Sequence[str], place: Origin
) -> tuple[ast.Class | None, ast.Symbol | None]:
    """What a modification changes, and its class; none for an attribute of a number."""
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
        found = _found(symbol.parent or cls, symbol.type)
        if not isinstance(found, ast.Class):
            return None, symbol
        cls = found
    return cls, symbol


def _check_variables(cls: ast.Class, nodes: Iterable[Any], place: Origin) -> None:
    """Every name in expressions is that of a component or constant."""
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
            where = _found(found.parent or cls, found.type)
            inside = _members(where) if isinstance(where, ast.Class) else {}
            if part not in inside:
                raise ModelError(f"{found.name} has no {part}{choice(part, inside)}", place)
            found = inside[part]
    elif _found(cls, name) is None:
        near = meant(similar(first, members)) if not rest else ""
        raise ModelError(f"{name} is not known in {cls.name}{near}", place)


def _check_connector(cls: ast.Class, end: ast.ComponentRef, place: Origin) -> None:
    """An end of connect(..): a connector of the class, or of one of its components."""
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
        found = _found(symbol.parent or where, symbol.type)
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
    return any(i is not None for indices in name.indices for i in indices) or any(
        map(_has_subscripts, name.child)
    )


def _is_connector(symbol: ast.Symbol, cls: ast.Class) -> bool:
    found = _found(symbol.parent or cls, symbol.type)
    signal = bool({"input", "output"} & set(symbol.prefixes))
    return signal or (isinstance(found, ast.Class) and found.type == "connector")


def _found(scope: ast.Class, name: ast.ComponentRef | str) -> Any:
    """What a name means in a class; None where it means nothing."""
    if str(name) in _BUILTIN:  # pymoca's class Real has a component of that name
        return scope.root.classes[str(name)]
    try:
        return find_name(scope, name)
    except (NameLookupError, RecursionError):
        return None


def similar(name: str, known: Iterable[str]) -> list[str]:
    """Names with nearly the same spelling."""
    return get_close_matches(name, sorted(known), n=3, cutoff=0.75)


def meant(near: Sequence[str]) -> str:
    """``: did you mean X or Y?``, or nothing."""
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def choice(name: str, known: Collection[str]) -> str:
    """``: did you mean X?; there is X, Y, Z``."""
    return f"{meant(similar(name, known))}; there is {', '.join(known) or 'none'}"
