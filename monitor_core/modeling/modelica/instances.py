"""From classes to the tree of instances: a drive with its components, theirs, and so on down to single quantities."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from monitor_core.modeling.components.units import parse
from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.changes import Bound, Changes, Scope
from monitor_core.modeling.modelica.standard_library import Leaf
from monitor_core.modeling.modelica.syntax import ClassDef, Component, Literal, Statement


@dataclass(slots=True, eq=False)
class Instance:
    """A component (or the whole model, whose path is "") with everything in it.

    ``base``: "Real", ... of a single quantity, else "".  ``leaf``: what the library component is that it is or extends,
    if so.  ``absent``: components switched off by their condition.  ``statements``: each with the class it stands in.
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
    """An error from inside that names no component, or one that this one is in, is about this one."""
    try:
        yield
    except ModelError as error:
        named = error.origin.component
        if named and not component.startswith(f"{named}."):
            raise
        raise ModelError(error.problem, replace(error.origin, component=component)) from None
