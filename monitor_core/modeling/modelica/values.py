"""What expressions are worth: Laurent sums in free parameters, and sums of variables with such coefficients."""

from __future__ import annotations

from dataclasses import replace

from monitor_core.modeling.components.linear import Linear, der
from monitor_core.modeling.flat import CONSTANT, ModelError, Origin
from monitor_core.modeling.laurent import Laurent
from monitor_core.modeling.modelica.arithmetic import (
    FUNCTIONS,
    constant,
    number_of,
    operation,
    without_variables,
)
from monitor_core.modeling.modelica.instances import Instance, Scope, about
from monitor_core.modeling.modelica.lookup import component, constant_outside
from monitor_core.modeling.modelica.names import Names
from monitor_core.modeling.modelica.syntax import (
    Array,
    Call,
    ClassDef,
    Component,
    Expression,
    Literal,
    Name,
    Number,
    Operation,
    Other,
)


class Values:
    """Evaluates expressions.

    A parameter with a value that is a number stays a parameter, that number its nominal value, unless it is final or
    a constant; a parameter with a value in terms of others is replaced by it.
    """

    def __init__(self, names: Names) -> None:
        self.names = names
        self.nominal: dict[str, float] = {}
        self._known: dict[Instance, Laurent] = {}
        self._constants: dict[tuple[ClassDef, str], Laurent] = {}
        self._busy: list[tuple[object, str, Origin]] = []

    # --- parameters ------------------------------------------------------------------------------------

    def parameter(self, instance: Instance) -> Laurent:
        """The value of a parameter in terms of the free ones.

        Raises:
            ModelError: it depends on itself, or in a way that is no Laurent sum; a constant without a value.
        """
        if instance not in self._known:
            with_value = instance.binding is not None
            value = self._bound(instance) if with_value else Laurent.symbol(instance.path)
            if not with_value and instance.variability == "constant":
                raise ModelError("a constant needs a value", instance.origin)
            self._known[instance] = self._free(instance, value)
        return self._known[instance]

    def _bound(self, instance: Instance) -> Laurent:
        bound = instance.binding
        assert bound is not None
        self._enter(instance, instance.path, bound.origin)
        with about(instance.path):
            value = self.constant(bound.expression, bound.scope)
        self._busy.pop()
        return value

    def _free(self, instance: Instance, value: Laurent) -> Laurent:
        folded = instance.final or instance.variability == "constant" or instance.base == "Integer"
        if folded or not value.is_number:
            return value
        self.nominal[instance.path] = number_of(value, _written_at(instance))
        return Laurent.symbol(instance.path)

    def _enter(self, key: object, name: str, origin: Origin) -> None:
        """Notes what is being evaluated, and where its value is written."""
        keys = [busy for busy, _, _ in self._busy]
        if key in keys:
            ring = self._busy[keys.index(key) :]
            loop = " -> ".join([*(n for _, n, _ in ring), name])
            _, last, where = ring[-1]
            raise ModelError(f"its value depends on itself: {loop}", replace(where, component=last))
        self._busy.append((key, name, origin))

    # --- expressions -----------------------------------------------------------------------------------

    def constant(self, expression: Expression, scope: Scope) -> Laurent:
        """The value of an expression without variables.

        Raises:
            ModelError: a variable occurs in it, or it is no Laurent sum.
        """
        value = self.linear(expression, scope)
        found = without_variables(value)
        if found is None:
            names = ", ".join(sorted(name for name, _ in value.terms if name != CONSTANT))
            problem = f"a parameter cannot depend on a variable: {names}"
            raise ModelError(problem, scope.origin(expression.line))
        return found

    def linear(self, expression: Expression, scope: Scope) -> Linear:
        """The value of an expression that is linear in the variables.

        Raises:
            ModelError: it is not; something in it is not supported; a name is unknown.
        """
        match expression:
            case Number(value=number):
                return constant(Laurent.number(number))
            case Name():
                return self._name(expression, scope)
            case Operation(symbol=symbol, operands=operands):
                values = [self.linear(operand, scope) for operand in operands]
                return operation(symbol, values, scope.origin(expression.line))
            case Call(function="der", arguments=(argument,)):
                value = self.linear(argument, scope)
                return der(Linear({s: c for s, c in value.terms.items() if s[0] != CONSTANT}))
            case Call():
                return self._call(expression, scope)
            case Literal(value=text):
                raise ModelError(
                    f"{_text(text)} stands where a number is wanted", scope.origin(expression.line)
                )
            case Array():
                raise ModelError("arrays are not supported", scope.origin(expression.line))
            case Other(what=what):
                raise ModelError(
                    f"{what} is not supported: only numbers, names, + - * / ^ and der(...) are",
                    scope.origin(expression.line),
                )

    def _call(self, call: Call, scope: Scope) -> Linear:
        function = FUNCTIONS.get(call.function.removeprefix("Modelica.Math."))
        origin = scope.origin(call.line)
        if function is None:
            known = ", ".join(sorted(FUNCTIONS))
            raise ModelError(f"function {call.function} is not supported; known are der, {known}", origin)
        arguments = [without_variables(self.linear(argument, scope)) for argument in call.arguments]
        numbers = [argument for argument in arguments if argument is not None]
        if len(numbers) < len(arguments):
            problem = (
                f"{call.function} of a variable: equations must be linear{_INSTEAD.get(call.function, '')}"
            )
            raise ModelError(problem, origin)
        free = sorted({name for number in numbers for name in number.names})
        if free:
            raise ModelError(
                f"{call.function} of a parameter ({', '.join(free)}) is no Laurent sum: "
                f"make {call.function}(...) a parameter of its own",
                origin,
            )
        try:
            value = float(function(*(number_of(number, origin) for number in numbers)))
            return constant(Laurent.number(value))
        except (ValueError, TypeError, OverflowError):
            raise ModelError(f"{call.function} has no value here", origin) from None

    def _name(self, name: Name, scope: Scope) -> Linear:
        found = component(name, scope)
        if found is None:
            declared = constant_outside(name, scope, self.names)
            return constant(self._constant(*declared, scope.origin(name.line)))
        origin = scope.origin(name.line)
        if found.base not in ("Real", "Integer"):
            raise ModelError(f"{name} is of type {found.base or found.cls.name}, not a number", origin)
        if name.subscripts:
            raise ModelError("arrays are not supported", origin)
        return constant(self.parameter(found)) if found.is_parameter else Linear.variable(found.path)

    def _constant(self, owner: ClassDef, declared: Component, origin: Origin) -> Laurent:
        name = f"{owner}.{declared.name}"
        if declared.variability != "constant" or declared.value is None:
            raise ModelError(
                f"{name} is not a constant with a value: only those can be used from inside", origin
            )
        key = (owner, declared.name)
        if key not in self._constants:
            self._enter(key, name, Origin(name, owner.file, declared.line))
            outside = Instance(str(owner), owner, Origin(name, owner.file, declared.line))
            self._constants[key] = self.constant(declared.value, Scope(outside, owner))
            self._busy.pop()
        return self._constants[key]


_INSTEAD = dict.fromkeys(("sin", "cos"), ", and gravity is AxisWatch.Gravity")


def _written_at(parameter: Instance) -> Origin:
    where = parameter.binding.origin if parameter.binding is not None else parameter.origin
    return replace(where, component=parameter.path)


def _text(value: str | bool) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()
