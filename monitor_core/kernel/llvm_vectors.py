"""Vectors of four or eight numbers as values of the kernel, where the compiler's own vectorisation is slow.

The innermost loops of the kernel are so short that most of the time of a vectorised loop is its setup.  Here four or
eight numbers are loaded, multiplied, added and stored as one value that stays in a register.  Each number gets the same
bits as alone: ``+`` and ``*`` are never fused, and ``fused`` always is if the machine can do it.  LLVM splits the
vectors into registers of the machine (AVX-512, AVX, SSE, NEON).
"""

import operator
from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

FOUR, EIGHT = 4, 8

# Numba has no type hints for its extension functions.
_typed: Any = signature
_infer: Any = infer_global
_lower: Any = lower_builtin
_At = types.uint64


class _Vector(types.Type):
    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Vector({width})")


def _llvm(width: int, element: Any = None) -> Any:
    return ir.VectorType(element or ir.DoubleType(), width)


@register_model(_Vector)
class _Model(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _llvm(fe_type.width))  # type: ignore[no-untyped-call]


def _operator(symbol: Any, instruction: str) -> None:
    class Typing(AbstractTemplate):
        def generic(self, args: Any, _kws: Any) -> Any:
            two = len(args) == 2 and isinstance(args[0], _Vector) and args[0] == args[1]
            return _typed(args[0], *args) if two else None

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)

    _infer(symbol)(Typing)
    _lower(symbol, _Vector, _Vector)(code)


_operator(operator.add, "fadd")
_operator(operator.mul, "fmul")
_operator(operator.truediv, "fdiv")


def _pointer(context: Any, builder: Any, kind: Any, array: Any, at: Any, width: int) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), _llvm(width).as_pointer())


def _intrinsic(function: Any) -> Callable[..., Any]:
    return cast("Callable[..., Any]", intrinsic(function))


def _loader(width: int) -> Callable[..., Any]:
    def load(_typing: Any, array: Any, _at: Any) -> Any:
        def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.load(_pointer(context, builder, sig.args[0], args[0], args[1], width), align=8)

        return _Vector(width)(array, _At), code

    return _intrinsic(load)


def _spreader(width: int) -> Callable[..., Any]:
    def spread(_typing: Any, _value: Any) -> Any:
        def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
            index = ir.IntType(32)
            single = builder.insert_element(ir.Constant(_llvm(width), ir.Undefined), args[0], index(0))
            return builder.shuffle_vector(single, single, ir.Constant(_llvm(width, index), [0] * width))

        return _Vector(width)(types.float64), code

    return _intrinsic(spread)


@_intrinsic
def store(_typing: Any, array: Any, _at: Any, value: Any) -> Any:
    """array[at], array[at + 1] .. = value, of a flat array; ``at`` is not negative."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, sig.args[0], args[0], args[1], sig.args[2].width)
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, _At, value), code


@_intrinsic
def fused(_typing: Any, a: Any, b: Any, c: Any) -> Any:
    """A b + c of vectors, rounded once; rounded twice, for every width, on a machine without a fast instruction."""

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        kind = args[0].type
        multiply_add = builder.module.declare_intrinsic(
            f"llvm.fmuladd.v{kind.count}f64", (), ir.FunctionType(kind, [kind] * 3)
        )
        return builder.call(multiply_add, args)

    return a(a, b, c), code


@_intrinsic
def larger(_typing: Any, a: Any, b: Any) -> Any:
    """The larger of each pair of elements; b if neither is larger."""

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", *args), *args)

    return a(a, b), code


@_intrinsic
def magnitude(_typing: Any, a: Any) -> Any:
    """Absolute values."""

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        kind = args[0].type
        fabs = builder.module.declare_intrinsic(f"llvm.fabs.v{kind.count}f64", (), ir.FunctionType(kind, [kind]))
        return builder.call(fabs, args)

    return a(a), code


@_intrinsic
def where_at_least(_typing: Any, a: Any, b: Any, value: Any) -> Any:
    """``value`` where a >= b, else 0."""

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        zero = ir.Constant(args[2].type, None)
        return builder.select(builder.fcmp_ordered(">=", args[0], args[1]), args[2], zero)

    return value(a, b, value), code


@_intrinsic
def power_of_two(_typing: Any, _k: Any) -> Any:
    """2^k for an integer k as float64, |k| <= 1000; for a single number, but the compiler can vectorise it."""

    def code(_context: Any, builder: Any, _sig: Any, args: Any) -> Any:
        # The sum has k + 1023 in its last bits, and these are the exponent of 2^k.
        bits, number = ir.IntType(64), ir.DoubleType()
        total = builder.fadd(args[0], ir.Constant(number, 1.5 * 2.0**52 + 1023))
        return builder.bitcast(builder.shl(builder.bitcast(total, bits), ir.Constant(bits, 52)), number)

    return types.float64(types.float64), code


load4, load8 = _loader(FOUR), _loader(EIGHT)
"""array[at], array[at + 1] .., of a flat array; ``at`` is not negative."""
spread4, spread8 = _spreader(FOUR), _spreader(EIGHT)
"""One number, four or eight times."""
