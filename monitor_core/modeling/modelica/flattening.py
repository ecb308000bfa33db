"""From the tree of instances to the flat model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from monitor_core.kernel.tables import ONE
from monitor_core.modeling.components.connections import connect
from monitor_core.modeling.components.fragments import Fragment, join
from monitor_core.modeling.components.linear import Linear
from monitor_core.modeling.flat import (
    CONSTANT,
    FlatComponent,
    FlatEquation,
    FlatInput,
    FlatModel,
    FlatVariable,
    ModelError,
)
from monitor_core.modeling.modelica.connecting import Wiring
from monitor_core.modeling.modelica.flat_parameters import flat_parameters, own_units, variable_unit
from monitor_core.modeling.modelica.instances import Instance, Scope, about, unit_of
from monitor_core.modeling.modelica.leaves import Part, bearing_joint, parts
from monitor_core.modeling.modelica.signal_connections import is_given, measured_torque, outputs
from monitor_core.modeling.modelica.standard_library import BEARING
from monitor_core.modeling.modelica.syntax import Connect, Equation
from monitor_core.modeling.modelica.values import Values


@dataclass
class Flattening:
    """The parts of a model collected so far."""

    model: Instance
    values: Values
    wiring: Wiring = field(default_factory=Wiring)
    own: list[FlatEquation] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)

    def flat(self) -> FlatModel:
        """The flat model.

        Raises:
            ModelError: equations that are not linear, impossible connections, contradicting parameters.
        """
        instances = list(self.model.tree())
        for instance in instances:
            self._gather(instance)
        library = join(part.fragment() for part in self.parts)
        torque = measured_torque(self.model, self.wiring, self.own)
        inputs = [*([torque] if torque is not None else []), *library.inputs]
        flanges = [i.path for i in instances if i.is_flange]
        flanges += [v.name.removesuffix(".phi") for v in library.variables if v.name.endswith(".flange.phi")]
        equations = (
            *library.equations,
            *self.own,
            *self.wiring.equalities,
            *connect(self.wiring.joints, dict.fromkeys(flanges)),
        )
        if any((CONSTANT, 0) in e.terms for e in self.own) and all(i.name != CONSTANT for i in inputs):
            inputs.append(FlatInput(CONSTANT, ONE))
        units = own_units(self.own, _declared_units(instances, library))
        given = {i.path for i in instances if is_given(i)}
        variables = tuple(v for v in _variables(instances, library, inputs, units) if v.name not in given)
        _check(variables, inputs, equations, self.model)
        kinds = {part.name: part.kind for part in self.parts}
        return FlatModel(
            name=self.model.cls.name,
            parameters=flat_parameters(self.model, self.parts, equations, self.values, units),
            variables=variables,
            inputs=tuple(inputs),
            sensors=outputs(self.model, library.sensors, kinds, self.wiring),
            equations=equations,
            origin=self.model.origin,
            components=tuple(self._components()),
        )

    # --- one instance ----------------------------------------------------------------------------------

    def _gather(self, instance: Instance) -> None:
        for statement, scope in instance.statements:
            if isinstance(statement, Connect):
                self.wiring.add(statement, scope)
            elif isinstance(statement, Equation):
                self.own.append(self._equation(statement, scope))
            else:
                problem = (
                    f"{statement.what} is not supported: write linear equations and connect(...) one by one"
                )
                raise ModelError(problem, scope.origin(statement.line))
        if instance.base == "Real" and not instance.is_parameter and instance.binding is not None:
            self.own.append(self._declared(instance))
        if instance.leaf is not None:
            found = list(parts(instance, self.values))
            self.parts.extend(found)
            if instance.leaf.kind == BEARING:
                joint = bearing_joint(instance, found)
                self.wiring.joints.append(joint)
                for end in joint.ends[1:]:
                    self.wiring.nodes.join(joint.ends[0].flange, end.flange)

    def _equation(self, equation: Equation, scope: Scope) -> FlatEquation:
        difference = self.values.linear(equation.left, scope) - self.values.linear(equation.right, scope)
        return FlatEquation(difference.terms, scope.origin(equation.line))

    def _declared(self, variable: Instance) -> FlatEquation:
        bound = variable.binding
        assert bound is not None
        with about(variable.path):
            value = self.values.linear(bound.expression, bound.scope)
        return FlatEquation((Linear.variable(variable.path) - value).terms, variable.origin)

    # --- for pictures ----------------------------------------------------------------------------------

    def _components(self) -> Iterator[FlatComponent]:
        grounds = {self.wiring.nodes.root(flange) for p in self.parts if p.kind == "fixed" for flange in p.at}
        for part in self.parts:
            leaders = [self.wiring.nodes.root(flange) for flange in part.at]
            nodes = tuple("ground" if leader in grounds else leader for leader in leaders)
            yield FlatComponent(part.name, part.kind, nodes, part.parameters, part.origin)


def _variables(
    instances: Iterable[Instance], library: Fragment, inputs: Iterable[FlatInput], units: Mapping[str, str]
) -> Iterator[FlatVariable]:
    """Those of the library, and those that the user declared."""
    known = {i.name for i in inputs}
    for variable in library.variables:
        if variable.name not in known:
            yield variable
    known |= {v.name for v in library.variables}
    for instance in instances:
        if instance.base in ("", "enumeration") or instance.is_parameter or instance.path in known:
            continue
        if instance.base != "Real":
            raise ModelError(f"a variable of type {instance.base} is not supported", instance.origin)
        unit = variable_unit(units.get(instance.path, ""))
        yield FlatVariable(instance.path, unit, origin=instance.origin)


def _declared_units(instances: Iterable[Instance], library: Fragment) -> dict[str, str]:
    """Of parameters and variables; angle and torque of a flange by its definition."""
    units = {i.path: unit_of(i) for i in instances if i.base == "Real"}
    units.update((v.name, v.unit) for v in library.variables)
    for flange in instances:
        if flange.is_flange:
            units.update({flange.inside("phi"): "rad", flange.inside("tau"): "N m"})
    return units


def _check(
    variables: Iterable[FlatVariable],
    inputs: Iterable[FlatInput],
    equations: tuple[FlatEquation, ...],
    model: Instance,
) -> None:
    """Every variable has an equation, there are as many of both, and no input is differentiated."""
    occurring = {name for equation in equations for name, _ in equation.terms}
    unknowns = list(variables)
    for variable in unknowns:
        if variable.name not in occurring:
            raise ModelError(_unused(variable.name), variable.origin)
    known = {i.name for i in inputs}
    for equation in equations:
        for name, order in equation.terms:
            if order and name in known:
                raise ModelError(
                    f"the derivative of {name}, a measured signal, is not known", equation.origin
                )
    if len(equations) != len(unknowns):
        missing = "one or more are missing" if len(equations) < len(unknowns) else "there are too many"
        problem = f"{len(equations)} equations for {len(unknowns)} variables: {missing}"
        raise ModelError(problem, model.origin)


def _unused(variable: str) -> str:
    owner, _, last = variable.rpartition(".")
    if last == "phi" and owner.rpartition(".")[2].startswith("flange"):
        return f"nothing is connected to {owner}"
    return f"{variable} occurs in no equation"
