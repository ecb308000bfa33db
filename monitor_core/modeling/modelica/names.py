"""The class that a name means: enclosing scopes, imports, inherited classes, the library."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import NoReturn

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.standard_library import ANY, library
from monitor_core.modeling.modelica.syntax import ClassDef, Extends, Name, Text


def root_of(texts: Sequence[Text]) -> ClassDef:
    """The nameless package that contains everything: the library, and the classes of the texts.

    A text's own Modelica or AxisWatch package is ignored: these are the library's.

    Raises:
        ModelError: a class is defined twice.
    """
    root = ClassDef("", "package", "", 0)
    root.classes.update(library())
    for text in sorted(texts, key=lambda t: len(t.within)):
        if text.within[:1] not in _LIBRARY:
            package = _package(root, text.within)
            for new in text.classes:
                _add(package, new)
    return root


_LIBRARY = (("Modelica",), ("AxisWatch",))


def _package(root: ClassDef, path: tuple[str, ...]) -> ClassDef:
    where = root
    for name in path:
        if name not in where.classes:
            where.classes[name] = ClassDef(name, "package", "", 0, where)
        where = where.classes[name]
    return where


def _add(package: ClassDef, new: ClassDef) -> None:
    if not package.path and (new.name,) in _LIBRARY:
        return
    old = package.classes.get(new.name)
    if old is not None:
        where = f"in {old.file}, line {old.line}" if old.file else "in the library"
        raise ModelError(
            f"{new.sort} {new.name} exists already {where}", Origin(file=new.file, line=new.line)
        )
    package.classes[new.name] = new
    new.parent = package


class Names:
    """Looks up classes.  Results are cached; the classes must not change after that."""

    def __init__(self, root: ClassDef) -> None:
        self.root = root
        self._found: dict[tuple[ClassDef, tuple[str, ...]], ClassDef | None] = {}
        self._searching: set[ClassDef] = set()

    def find(self, scope: ClassDef, name: Name, origin: Origin) -> ClassDef:
        """The class that a name written inside of ``scope`` means.

        Raises:
            ModelError: there is none; the text lists similar names.
        """
        found = self.search(scope, name.parts)
        if found is None:
            self._unknown(scope, name, origin)
        return found

    def search(self, scope: ClassDef, parts: tuple[str, ...]) -> ClassDef | None:
        """As ``find``; None where there is none."""
        key = (scope, parts)
        if key in self._found:
            return self._found[key]
        first = next(filter(None, (self._visible(s, parts[0]) for s in outwards(scope))), None)
        first = first or self.root.classes.get(parts[0]) or self._anything_imported(scope, parts[0])
        found = self._within(first, parts[1:])
        if not self._searching:  # else what is inherited may have been passed over
            self._found[key] = found
        return found

    def bases(self, cls: ClassDef) -> Iterator[tuple[Extends, ClassDef]]:
        """The base classes, each with the clause that names it.

        Raises:
            ModelError: a base class is unknown.
        """
        for extends in cls.extends:
            origin = Origin(str(cls), cls.file, extends.line)
            yield extends, self.find(cls, extends.base, origin)

    def _within(self, cls: ClassDef | None, parts: tuple[str, ...]) -> ClassDef | None:
        for part in parts:
            if cls is None:
                return None
            cls = self._member(cls, part) or self._any(cls, part)
        return cls

    @staticmethod
    def _any(cls: ClassDef, name: str) -> ClassDef | None:
        if str(cls) in ANY and not name.startswith(("Boolean", "Integer")):
            return cls.classes[ANY[str(cls)]]
        return None

    def _visible(self, scope: ClassDef, name: str) -> ClassDef | None:
        return self._member(scope, name) or self._imported(scope, name)

    def _member(self, cls: ClassDef, name: str) -> ClassDef | None:
        if name in cls.classes:
            return cls.classes[name]
        return self._inherited(cls, name)

    def _inherited(self, cls: ClassDef, name: str) -> ClassDef | None:
        if cls in self._searching or not cls.extends:
            return None
        self._searching.add(cls)
        try:
            for extends in cls.extends:
                base = self.search(cls, extends.base.parts)
                found = self._member(base, name) if base is not None else None
                if found is not None:
                    return found
        finally:
            self._searching.discard(cls)
        return None

    def _imported(self, scope: ClassDef, name: str) -> ClassDef | None:
        for clause in scope.imports:
            found = None
            if clause.alias == name:
                found = self._within(self.root, clause.path)
            elif clause.alias == "*":
                package = self._within(self.root, clause.path)
                found = self._member(package, name) if package is not None else None
            if found is not None:
                return found
        return None

    def _anything_imported(self, scope: ClassDef, name: str) -> ClassDef | None:
        """By ``import Modelica.Blocks.Sources.*``, where every name means something; so this comes last."""
        stars = [c.path for s in outwards(scope) for c in s.imports if c.alias == "*"]
        packages = filter(None, (self._within(self.root, path) for path in stars))
        return next(filter(None, (self._any(package, name) for package in packages)), None)

    def _unknown(self, scope: ClassDef, name: Name, origin: Origin) -> NoReturn:
        lost = next((c for s in outwards(scope) for c in s.imports if c.alias == name.parts[0]), None)
        package = self.search(scope, name.parts[:-1]) if len(name.parts) > 1 else None
        of_library = not package.file if package is not None else name.parts[0] == "Modelica"
        problem = f"class {name} is not {'supported' if of_library else 'known'}"
        if package is not None and package.classes:
            near = did_you_mean(similar(name.parts[-1], package.classes))
            problem += near + listed(package.classes, "; there is")
        elif lost is not None:
            problem += f": its import (line {lost.line}) of {'.'.join(lost.path)} finds nothing"
        else:
            problem += did_you_mean(self._like(name.parts[-1]))
        raise ModelError(problem, origin)

    def _like(self, name: str) -> list[str]:
        """Full names of components whose last part is written nearly the same."""
        known = [c for c in descendants(self.root) if c.sort in ("model", "block", "class", "connector")]
        near = similar(name, {c.name for c in known})
        return [str(c) for last in near for c in known if c.name == last]


def outwards(scope: ClassDef) -> Iterator[ClassDef]:
    """The class itself, and those around it."""
    where: ClassDef | None = scope
    while where is not None:
        yield where
        where = where.parent


def descendants(cls: ClassDef) -> Iterator[ClassDef]:
    """All classes inside, at any depth."""
    for inner in cls.classes.values():
        yield inner
        yield from descendants(inner)


def similar(name: str, known: Iterable[str]) -> list[str]:
    """Names with nearly the same spelling."""
    return get_close_matches(name, sorted(known), n=3, cutoff=0.75)


def did_you_mean(near: Sequence[str]) -> str:
    """``: did you mean X or Y?``, or nothing."""
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def listed(names: Iterable[str], there_is: str) -> str:
    """``there is a, b, c``; ``there is none``."""
    return f"{there_is} {', '.join(names) or 'none'}"
