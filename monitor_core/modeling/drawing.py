"""A drive drawn in Python: components at named nodes; those at the same node are connected there.

    Drawing("two-mass", [
        part("torque", "torque", "shaft", kT="kT"),
        part("inertia", "motor", "shaft", J="Jm"),
        part("viscous-friction", "bearing", "shaft", d="fm"),
        part("spring-damper", "belt", "shaft", "load", c="k", d="d"),
        part("inertia", "arm", "load", J="Ja"),
        part("speed-sensor", "encoder", "shaft"),
    ]).flat()

The drives of the library are drawn so.  A user draws in Modelica, where every mistake is reported with its line.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from monitor_core.modeling.components import COMPONENT_KINDS, join
from monitor_core.modeling.components.fragments import End, Fragment, Joint, connect
from monitor_core.modeling.components.uses import DriveComponent, Use, first_use, infer, sign_of
from monitor_core.modeling.flat import FlatComponent, FlatModel, FlatParameter, Origin
from monitor_core.modeling.laurent import Laurent


def part(kind: str, name: str, *nodes: str, **parameters: str | Laurent) -> DriveComponent:
    """A component of a kind of component_kinds.py: ``part("spring", "belt", "shaft", "load", c="k")``.

    A parameter is a name, or a Laurent sum of names; one that is not given is called "<component>.<role>".

    Raises:
        KeyError: there is no such kind.
    """
    known = COMPONENT_KINDS[kind]
    given = {role.name: parameters.get(role.name, f"{name}.{role.name}") for role in known.roles}
    values = {role: Laurent.symbol(value) if isinstance(value, str) else value for role, value in given.items()}
    origin = Origin(name)
    uses = (Use(value, known.role(role).unit, origin, known.role(role)) for role, value in values.items())
    return DriveComponent(known, name, values, origin, tuple(uses), nodes)


@dataclass(frozen=True)
class Drawing:
    """A drive.  ``meanings``: parameters in words, in the order of lists; the others follow as they occur."""

    name: str
    components: Sequence[DriveComponent]
    meanings: Mapping[str, str] = field(default_factory=dict)

    def flat(self) -> FlatModel:
        """All equations of the drive, and its parameters with units and meanings.

        Raises:
            ModelError: the uses of a parameter contradict each other in their units.
        """
        joined = join(map(_measured, self.components))
        flanges = [f"{each.name}.{flange}" for each in self.components for flange in each.kind.flanges]
        return FlatModel(
            name=self.name,
            parameters=tuple(self._parameters()),
            variables=joined.variables,
            inputs=joined.inputs,
            sensors=joined.sensors,
            equations=joined.equations + connect(self._joints(), flanges),
            components=tuple(
                FlatComponent(each.name, each.kind.name, each.nodes, each.parameters) for each in self.components
            ),
        )

    def _parameters(self) -> Iterator[FlatParameter]:
        uses = [use for each in self.components for use in each.uses]
        units = infer(uses)
        occurring = (name for use in uses for name in sorted(use.value.names))
        for name in dict.fromkeys([*self.meanings, *occurring]):
            mine = [use for use in uses if name in use.value.names]
            first = first_use(mine)
            meaning = self.meanings.get(name) or first.meaning(first.origin.component.replace("_", " "))
            yield FlatParameter(name, units[name], meaning, None, *sign_of(name, mine, None), first.origin)

    def _joints(self) -> Iterator[Joint]:
        """A connection set for each node.  The second flange of an inertia at one node stays free: it is rigid."""
        ends: dict[str, list[End]] = {}
        for each in self.components:
            for node, flange in zip(dict.fromkeys(each.nodes), each.kind.flanges, strict=False):
                ends.setdefault(node, []).append(End(f"{each.name}.{flange}"))
        for node, at in ends.items():
            yield Joint(node, tuple(at), Origin(f"node {node}"))


def _measured(part: DriveComponent) -> Fragment:
    """The equations of a part; a torque is the measured one, as drawings have no signals."""
    new = part.fragment()
    for signal in part.kind.signals_in:
        new = new.measured(f"{part.name}.{signal}")
    return new
