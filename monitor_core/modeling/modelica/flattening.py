"""Converts pymoca's flat class to the flat model: library components, connections, the user's own equations.

pymoca instantiates, resolves all names and modifications, and flattens.  For pymoca the components of the library have
no equations: these are in component_kinds.py, which drawings in Python share.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from pymoca import ast
from pymoca.tree import InstanceClass, InstanceSymbol, ModelicaError, flatten_instance, instantiate

from monitor_core.kernel.tables import ONE
from monitor_core.modeling.components.fragments import End, Fragment, Joint, LinearForm, connect, join
from monitor_core.modeling.components.uses import DriveComponent
from monitor_core.modeling.flat import (
    CONSTANT,
    FlatComponent,
    FlatEquation,
    FlatInput,
    FlatModel,
    FlatVariable,
    ModelError,
    Origin,
)
from monitor_core.modeling.modelica.flat_parameters import flat_parameters, own_units, variable_unit
from monitor_core.modeling.modelica.leaves import Placed, bearing_joint, parts
from monitor_core.modeling.modelica.library import BEARING, LEAVES, Leaf
from monitor_core.modeling.modelica.parsing import is_parameter, place_of
from monitor_core.modeling.modelica.signals import SignalGroups
from monitor_core.modeling.modelica.values import ExpressionValues, plain


def flatten(root: ast.Tree, model: ast.Class) -> FlatModel:
    """The flat model of a class."""
    try:
        instance = instantiate(root, model.full_name)
        flat = flatten_instance(instance, expand_connect=False)
    except IndexError:
        problem = "pymoca cannot flatten it: a modification has no value (is an = missing?)"
        raise ModelError(problem, place_of(model, model.name)) from None
    except (ModelicaError, NotImplementedError, KeyError, AssertionError, AttributeError) as error:
        raise ModelError(f"pymoca cannot flatten it: {error}", place_of(model, model.name)) from None
    return _Flattening(root, model, instance, flat).flat_model()


class _Flattening:
    """The parts of a model, collected from the instance and its flat class."""

    def __init__(self, root: ast.Tree, model: ast.Class, instance: InstanceClass, flat: InstanceClass) -> None:
        self.model, self.flat = model, flat
        self.places: dict[str, Origin] = {}
        self.comments: dict[str, str] = {}
        self.placed: list[Placed] = []
        self.flanges: list[str] = []
        self._visit(instance, "", place_of(model))
        self.values = ExpressionValues(flat.symbols, self.places, root)
        self.parts: list[DriveComponent] = []
        self.joints: list[Joint] = []
        for placed in self.placed:
            found = list(parts(placed, self.values))
            self.parts += found
            if placed.leaf.kind == BEARING:
                self.joints.append(bearing_joint(placed, found))
        kinds = {p.path: p.leaf.kind for p in self.placed} | {p.name: p.kind.name for p in self.parts}
        self.signals = SignalGroups(_causality(instance), kinds, self.places)
        self.own: list[FlatEquation] = []
        self.equalities: list[FlatEquation] = []
        for equation in flat.equations:
            self._add(equation)

    def _visit(self, cls: InstanceClass, prefix: str, place: Origin) -> None:
        """Visit all components inside, and note their places; library declarations get the place of their user."""
        for name, symbol in cls.symbols.items():
            path = f"{prefix}{name}"
            written = place_of(symbol.ast_ref, path)
            self.places[path] = written if written.file else replace(place, component=path)
            if written.file:
                self.comments[path] = re.sub(r'"\s*\+\s*"', "", symbol.ast_ref.comment)
            kind = symbol.type
            if not isinstance(kind, InstanceClass):
                continue
            if kind.type == "connector" and _is_flange(kind):
                self.flanges.append(path)
            leaf = _leaf(kind)
            if leaf is not None:
                self.placed.append(Placed(path, leaf, self.places[path]))
            self._visit(kind, f"{path}.", self.places[path])
        for base in cls.extends:
            if isinstance(base, InstanceClass) and base.name not in ("Real", "Integer", "Boolean", "String"):
                self._visit(base, prefix, place)

    def _add(self, equation: ast.Equation) -> None:
        if isinstance(equation, ast.ConnectClause):
            self._connect(equation)
            return
        place = place_of(equation)
        if not place.file:  # the value of a variable, as an equation
            place = self.places.get(str(equation.left), place_of(self.model))
        difference = self.values.linear(equation.left, place) - self.values.linear(equation.right, place)
        self.own.append(FlatEquation(difference.terms, place))

    def _connect(self, clause: ast.ConnectClause) -> None:
        left, right, place = str(clause.left), str(clause.right), place_of(clause)
        flanges = [name in self.flanges for name in (left, right)]
        for name, flange in zip((left, right), flanges, strict=True):
            if not flange and name not in self.flat.symbols:
                problem = f"{name} cannot be connected: a flange must have an angle phi and a flow tau"
                raise ModelError(problem, place)
        if flanges[0] != flanges[1]:
            kinds = [f"{n} is a {'flange' if f else 'signal'}" for n, f in zip((left, right), flanges, strict=True)]
            raise ModelError(f"{' and '.join(kinds)}: they cannot be connected", place)
        if flanges[0]:
            ends = (End(left, not clause._left_inner), End(right, not clause._right_inner))
            self.joints.append(Joint(left, ends, place))
        elif self.signals.connect(left, right):
            equal = LinearForm.variable(left) - LinearForm.variable(right)
            self.equalities.append(FlatEquation(equal.terms, place))

    def flat_model(self) -> FlatModel:
        """The complete, checked flat model."""
        library = join(part.fragment() for part in self.parts)
        torque = self.signals.measured_torque(self.own)
        inputs = [*([torque] if torque is not None else []), *library.inputs]
        flanges = [
            *self.flanges,
            *(v.name[: -len(".phi")] for v in library.variables if v.name.endswith("flange.phi")),
        ]
        equations = (
            *library.equations,
            *self.own,
            *self.equalities,
            *connect(self.joints, dict.fromkeys(flanges)),
        )
        if any((CONSTANT, 0) in e.terms for e in self.own) and all(i.name != CONSTANT for i in inputs):
            inputs.append(FlatInput(CONSTANT, ONE))
        units = own_units(self.own, self._declared_units(library))
        known = {i.name for i in inputs} | self.signals.given()
        variables = tuple(v for v in self._variables(library, units) if v.name not in known)
        _check(variables, inputs, equations, place_of(self.model, self.model.name))
        return FlatModel(
            name=self.model.name,
            parameters=flat_parameters(self.values, self.comments, self.parts, equations, units),
            variables=variables,
            inputs=tuple(inputs),
            sensors=self.signals.outputs(library.sensors),
            equations=equations,
            components=tuple(self._components()),
            origin=place_of(self.model, self.model.name),
        )

    def _components(self) -> Iterator[FlatComponent]:
        """The parts, connected also through the flanges of the models that hold them."""
        node: dict[str, str] = {}
        for joint in self.joints:
            names = [end.flange for end in joint.ends]
            same = {node.get(name, name) for name in names}
            node.update(dict.fromkeys([*names, *(n for n, to in node.items() if to in same)], min(same)))
        for part in self.parts:
            nodes = tuple(node.get(flange, flange) for flange in part.nodes)
            yield FlatComponent(part.name, part.kind.name, nodes, part.parameters)

    def _variables(self, library: Fragment, units: Mapping[str, str]) -> Iterator[FlatVariable]:
        """Variables of the library components, and those that the user declared."""
        yield from library.variables
        known = {v.name for v in library.variables}
        for name, symbol in self.flat.symbols.items():
            if is_parameter(symbol) or name in known or ast.is_enumeration(symbol.type):
                continue
            if symbol.type.name != "Real":
                raise ModelError(f"a variable of type {symbol.type.name} is not supported", self.places[name])
            yield FlatVariable(name, variable_unit(units.get(name, "")), origin=self.places[name])

    def _declared_units(self, library: Fragment) -> dict[str, str]:
        """Units of parameters and variables; of angle and torque of a flange by its definition."""
        symbols = self.flat.symbols.items()
        units = {name: str(plain(s.unit) or "") for name, s in symbols if s.type.name == "Real"}
        units.update((v.name, v.unit) for v in library.variables)
        for flange in self.flanges:
            units.update({f"{flange}.phi": "rad", f"{flange}.tau": "N m"})
        return units


def _is_flange(connector: InstanceClass) -> bool:
    members = {name: "flow" in symbol.prefixes for name, symbol in _symbols(connector)}
    return members == {"phi": False, "tau": True}


def _symbols(cls: InstanceClass) -> Iterator[tuple[str, InstanceSymbol]]:
    yield from cls.symbols.items()
    for base in cls.extends:
        if isinstance(base, InstanceClass):
            yield from _symbols(base)


def _causality(model: InstanceClass) -> dict[str, str]:
    """Causality ("input", "output") of the signals of the model itself, of which some are connectors."""
    found: dict[str, str] = {}
    for name, symbol in _symbols(model):
        if is_parameter(symbol):
            continue
        sorts = [p for p in symbol.prefixes if p in ("input", "output")]
        kind: object = symbol.type
        while not sorts and isinstance(kind, InstanceClass):
            sorts = [getattr(kind.ast_ref, "causality", "")]
            kind = kind.extends[0] if kind.extends and not sorts[0] else None
            sorts = [sort for sort in sorts if sort]
        if sorts:
            found[name] = sorts[0]
    return found


def _leaf(cls: InstanceClass) -> Leaf | None:
    """The component of the library that a class is, or that it extends."""
    name = cls.ast_ref.full_name if cls.ast_ref is not None else ""
    if name in LEAVES:
        return LEAVES[name]
    bases = (_leaf(base) for base in cls.extends if isinstance(base, InstanceClass))
    return next((leaf for leaf in bases if leaf is not None), None)


def _check(
    variables: Iterable[FlatVariable],
    inputs: Iterable[FlatInput],
    equations: tuple[FlatEquation, ...],
    origin: Origin,
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
                raise ModelError(f"the derivative of {name}, a measured signal, is not known", equation.origin)
    if len(equations) != len(unknowns):
        missing = "one or more are missing" if len(equations) < len(unknowns) else "there are too many"
        problem = f"{len(equations)} equations for {len(unknowns)} variables: {missing}"
        raise ModelError(problem, origin)


def _unused(variable: str) -> str:
    owner, _, last = variable.rpartition(".")
    if last == "phi" and owner.rpartition(".")[2].startswith("flange"):
        return f"nothing is connected to {owner}"
    return f"{variable} occurs in no equation"
