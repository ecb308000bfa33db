"""Laurent sums as tests write them: "1/r", "m*l^2", "-(fm + dg*r^2)/Jm"."""

import ast

from monitor_core.modeling.laurent import Laurent


def parse(text: str) -> Laurent:
    """The sum of a text of names, numbers, + - * / ^ and brackets; names may have dots ("motor.J")."""
    return _value(ast.parse(text.strip().replace("^", "**"), mode="eval").body)


def _value(node: ast.expr) -> Laurent:
    match node:
        case ast.Name() | ast.Attribute():
            return Laurent.symbol(ast.unparse(node))
        case ast.Constant(value=int() | float() as number):
            return Laurent.number(number)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand)
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(value=int() as exponent)):
            return _value(base) ** exponent
        case ast.BinOp(left=left, op=operator, right=right):
            a, b = _value(left), _value(right)
            match operator:
                case ast.Add():
                    return a + b
                case ast.Sub():
                    return a - b
                case ast.Mult():
                    return a * b
                case ast.Div():
                    return a / b
    raise ValueError(ast.unparse(node))
