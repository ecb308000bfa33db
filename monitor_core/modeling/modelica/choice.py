"""The choice of the class of the texts that is the drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.names import Names, descendants, did_you_mean, listed, similar
from monitor_core.modeling.modelica.syntax import ClassDef, Text


def choose(texts: Sequence[Text], names: Names, model: str | None) -> ClassDef:
    """The class of that name, otherwise the only model that no other class of the texts uses or extends.

    Raises:
        ModelError: there is none, or several.
    """
    classes = [c for c in descendants(names.root) if c.file]
    models = [c for c in classes if c.sort in ("model", "block", "class")]
    if not models:
        files = ", ".join(text.source.name for text in texts)
        empty = all(not text.source.text.strip() for text in texts)
        problem = "the text is empty" if empty else 'there is no model in it: "model Name ... end Name;"'
        raise ModelError(problem, Origin(file=files))
    return _named(model, classes, names) if model is not None else _only(models, classes, names)


def _named(model: str, classes: list[ClassDef], names: Names) -> ClassDef:
    found = names.search(names.root, tuple(model.split(".")))
    same = [c for c in classes if c.name == model] if found is None else [found]
    if len(same) != 1 or not same[0].file:
        known = [str(c) for c in classes if c.sort in ("model", "block", "class")]
        last = similar(model.split(".")[-1], {k.split(".")[-1] for k in known})
        near = did_you_mean([k for k in known if k.split(".")[-1] in last])
        raise ModelError(
            f"there is no model {model}{near}{listed(known, '; there is')}", Origin(file=classes[0].file)
        )
    return same[0]


def _only(models: list[ClassDef], classes: list[ClassDef], names: Names) -> ClassDef:
    uses = {cls: set(_used_by(cls, names)) for cls in classes}
    used = set[ClassDef]().union(*uses.values())
    free = [c for c in models if c not in used and not c.partial]
    if len(free) == 1:
        return free[0]
    if len(models) == 1:
        return models[0]
    circular = [c for c in models if not c.partial and _reaches(c, c, uses)]
    if not free and circular:
        return circular[0]  # its instantiation says what is wrong with it
    if not free:
        problem = "every model is partial, or used by another one; say which is the drive"
        raise ModelError(f"{problem}{listed(map(str, models), ': there is')}", Origin(file=models[0].file))
    problem = f"several models could be the drive; say which: {', '.join(map(str, free))}"
    raise ModelError(problem, Origin(file=free[0].file))


def _used_by(cls: ClassDef, names: Names) -> Iterator[ClassDef]:
    for name in (*(c.type for c in cls.components.values()), *(e.base for e in cls.extends)):
        found = names.search(cls, name.parts)
        if found is not None and found is not cls:
            yield found


def _reaches(start: ClassDef, end: ClassDef, uses: dict[ClassDef, set[ClassDef]]) -> bool:
    """Whether a class uses another one, directly or indirectly."""
    front, seen = {start}, set[ClassDef]()
    while front:
        seen |= front
        front = set[ClassDef]().union(*(uses[c] for c in front if c in uses))
        if end in front:
            return True
        front -= seen
    return False
