"""Functions that only compiled functions call: they work, and cost no machine code of their own."""

from typing import Any

import numpy as np
from numba import njit

from monitor_core.arrays import Floats
from monitor_core.kernel.compile import allocating, array_function, kernel, outlined


@kernel
def _doubled(x: float) -> float:
    return 2.0 * x


@outlined
def _shifted(x: Floats, by: float) -> None:
    for i in range(x.size):
        x[i] += _doubled(by)


@array_function
def _products(A: Floats, x: Floats) -> Floats:
    return A * x + x


@allocating
def _zeros(n: int) -> Floats:
    return np.zeros(n)


def _together(A: Floats, by: float) -> Floats:
    x = _zeros(A.size)
    _shifted(x, by)
    return _products(A, x)


def test_linked_functions_are_machine_code_only_in_the_function_that_python_calls() -> None:
    compile_: Any = njit
    compiled = compile_(_together)
    np.testing.assert_array_equal(compiled(np.array([1.0, 3.0]), 0.5), [2.0, 4.0])
    linked: list[Any] = [_doubled, _shifted, _products, _zeros]
    assert [_has_machine_code(function) for function in (compiled, *linked)] == [True, *[False] * len(linked)]


def _has_machine_code(dispatcher: Any) -> bool:
    """Whether LLVM has got the module of the function to make machine code of it."""
    (made,) = dispatcher.overloads.values()
    library = made.library
    return library._final_module in library._codegen._engine._ee._modules
