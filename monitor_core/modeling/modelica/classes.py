"""The classes of Modelica texts: the tree of all classes, the class of the drive, and name lookup."""

import copy
from collections.abc import Collection, Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar

from pymoca import ast
from pymoca.parser import ModelicaFile
from pymoca.tree import NameLookupError, find_name

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.library import library
from monitor_core.modeling.modelica.parsing import Source, place_of

ClassT = TypeVar("ClassT", bound=ast.Class)

LIBRARY = ("Modelica", "AxisWatch")
MODELS = ("model", "block", "class")
BUILTIN = ("Real", "Integer", "Boolean", "String")


def tree_of(files: Sequence[ModelicaFile]) -> ast.Tree:
    """The library and the classes of the texts; a text's own Modelica or AxisWatch package is ignored."""
    root = _copy(library())
    for file in sorted(files, key=lambda f: len(f.within)):
        path: tuple[str, ...] = file.within[0].to_tuple() if file.within else ()
        if path[:1] and path[0] in LIBRARY:
            continue
        package: ast.Class = root
        for name in path:
            package = package.classes.setdefault(name, ast.Class(name=name, type="package"))
        for name, new in file.classes.items():
            if path or name not in LIBRARY:
                _add(package, new)
    root.update_parent_refs()
    return root


def _copy(package: ClassT) -> ClassT:
    """A copy of a package with copies of its classes at any depth.

    The declarations in the classes are only read, so they are shared: copying them too would take too long.
    """
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


def choose(root: ast.Tree, sources: Sequence[Source], model: str | None) -> ast.Class:
    """The class with this name, or without a name the only model that no other class of the texts uses or extends."""
    classes = own_classes(root)
    models = [c for c in classes if c.type in MODELS]
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
    found = look_up(root, model)
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
        found = look_up(cls, name)
        if isinstance(found, ast.Class) and found is not cls:
            yield found


def descendants(cls: ast.Class) -> Iterator[ast.Class]:
    """All classes inside, at any depth."""
    for inner in cls.classes.values():
        yield inner
        yield from descendants(inner)


def look_up(scope: ast.Class, name: ast.ComponentRef | str) -> Any:
    """The element that a name denotes in a class; None if there is none."""
    if str(name) in BUILTIN:  # pymoca's class Real has a component of that name
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
