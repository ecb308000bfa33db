"""Expressions: from the parse tree to syntax.py."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from monitor_core.modeling.modelica.syntax import (
    Array,
    Call,
    Expression,
    Literal,
    Name,
    Number,
    Operation,
    Other,
)


def expression(ctx: Any) -> Expression:
    """An ``expression``, ``simple_expression``, ``expr`` or ``primary`` of the grammar."""
    found: Expression = _RULES[_rule(ctx)](ctx)
    return found


def name(ctx: Any) -> Name:
    """A ``component_reference``, ``type_specifier`` or ``name``; a leading dot (from the root) is dropped."""
    parts = tuple(part for part in _plain(ctx).split(".") if part)
    return Name(parts, line(ctx), subscripts="[" in ctx.getText())


def line(ctx: Any) -> int:
    """The line on which it begins."""
    return int(ctx.start.line)


def words(ctx: Any) -> list[str]:
    """The terminal symbols directly below."""
    return [child.getText() for child in (ctx.children or []) if not hasattr(child, "children")]


def _rule(ctx: Any) -> str:
    return type(ctx).__name__.removesuffix("Context")


def _plain(ctx: Any) -> str:
    """Without array subscripts."""
    elements = getattr(ctx, "component_reference_element", None)
    return ".".join(e.IDENT().getText() for e in elements()) if elements else str(ctx.getText())


def _range(ctx: Any) -> Expression:
    return expression(ctx.expr(0)) if len(ctx.expr()) == 1 else Other("a range a:b", line(ctx))


def _binary(ctx: Any) -> Expression:
    operator = ctx.op.text.removeprefix(".")
    operands = ctx.primary() if _rule(ctx) == "Expr_exp" else ctx.expr()
    return Operation(operator, tuple(map(expression, operands)), line(ctx))


def _logical(symbol: str) -> Any:
    return lambda ctx: Operation(symbol, tuple(map(expression, ctx.expr())), line(ctx))


def _unary(symbol: str, ctx: Any) -> Expression:
    return Operation(symbol, (expression(ctx.expr()),), line(ctx))


def _number(ctx: Any) -> Expression:
    """Exact; what a computer's number cannot hold is refused before 10^999999999 is written out."""
    text = ctx.getText()
    try:
        readable = 0 < abs(float(text)) < float("inf") or not text.lower().split("e")[0].strip("0.")
    except ValueError:  # 1.2.3, which the grammar lets pass
        readable = False
    return Number(Fraction(text), line(ctx)) if readable else Other(f"the number {text}", line(ctx))


def _call(ctx: Any) -> Expression:
    function = ctx.getChild(0).getText()
    inner = ctx.function_call_args().function_arguments()
    if inner is None:
        return Call(function, (), line(ctx))
    if inner.named_arguments() is not None or inner.for_indices():
        return Other(f"the call of {function} with named arguments", line(ctx))
    return Call(function, _arguments(inner), line(ctx))


def _arguments(ctx: Any) -> tuple[Expression, ...]:
    """``a, b, c``; a partial function application among them is refused."""
    return tuple(
        expression(a.expression())
        if _rule(a) == "Argument_expression"
        else Other("a function argument", line(a))
        for a in ctx.function_argument()
    )


def _brackets(ctx: Any) -> Expression:
    inner = ctx.output_expression_list().expression()
    return expression(inner[0]) if len(inner) == 1 else Other("a list in round brackets", line(ctx))


def _matrix(ctx: Any) -> Expression:
    rows = [Array(tuple(map(expression, row.expression())), line(row)) for row in ctx.expression_list()]
    return Array(tuple(rows), line(ctx))


def _braces(ctx: Any) -> Expression:
    inner = ctx.function_arguments()
    if inner.named_arguments() is not None or inner.for_indices():
        return Other("an array built by a loop", line(ctx))
    return Array(_arguments(inner), line(ctx))


_RULES: dict[str, Any] = {
    "Expression_simple": lambda ctx: expression(ctx.simple_expression()),
    "Expression_if": lambda ctx: Other("an if-expression", line(ctx)),
    "Simple_expression": _range,
    "Expr_signed": lambda ctx: _unary(ctx.op.text, ctx),
    "Expr_exp": _binary,
    "Expr_mul": _binary,
    "Expr_add": _binary,
    "Expr_rel": _binary,
    "Expr_not": lambda ctx: _unary("not", ctx),
    "Expr_and": _logical("and"),
    "Expr_or": _logical("or"),
    "Expr_primary": lambda ctx: expression(ctx.primary()),
    "Primary_unsigned_number": _number,
    "Primary_string": lambda ctx: Literal(ctx.getText()[1:-1], line(ctx)),
    "Primary_false": lambda ctx: Literal(False, line(ctx)),
    "Primary_true": lambda ctx: Literal(True, line(ctx)),
    "Primary_function": _call,
    "Primary_derivative": _call,
    "Primary_initial": _call,
    "Primary_component_reference": lambda ctx: name(ctx.component_reference()),
    "Primary_output_expression_list": _brackets,
    "Primary_expression_list": _matrix,
    "Primary_function_arguments": _braces,
    "Primary_end": lambda ctx: Other("end", line(ctx)),
}
