"""How the functions of the kernel are compiled.

Only ``entry``, ``array_function`` and ``allocating`` functions count references to arrays.  All others use the arrays
that they are given: without counting, a named tuple of arrays costs no more as an argument than each array by itself,
so what travels together is one argument, and there is less to compile.  They must not make or return arrays.

No fast-math: one axis and many axes give the same bits.  Division as in numpy: a test for zero would prevent SIMD.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

# Numba imports this when something is compiled or loaded for the first time, which adds types to its table of types: a
# call from another thread that looks them up at that moment would fail.
import numba.experimental.function_type  # noqa: F401
from llvmlite import binding as llvm
from numba import njit, typeof

# Most loops run over a few states, parameters or entries of A.  LLVM would repeat their bodies eight times for long
# runs that never come: the code would be twice as long and no faster, and compiling would take a quarter longer.
llvm.set_option("axiswatch", "-unroll-runtime=false")

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _compiled(function: Callable[_P, _R], nogil: bool = True, **options: bool | str) -> Callable[_P, _R]:
    # Unused wrappers would cost a third of the compile time; numba's type hints lack these options.
    compile_: Any = njit
    decorator = compile_(nogil=nogil, error_model="numpy", no_cfunc_wrapper=True, **options)
    return cast("Callable[_P, _R]", decorator(function))


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a piece of the kernel that is called only by other pieces, never from Python.

    It is inlined into its callers: each array that is passed to a call costs seven words on the stack, and a sample
    passes hundreds of arrays.
    """
    return _compiled(function, no_cpython_wrapper=True, forceinline=True, _nrt=False)


def outlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that are called seldom or are long: compiled once, not into every caller."""
    return _compiled(function, no_cpython_wrapper=True, _nrt=False)


def array_function(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``outlined``, for functions that calculate with arrays as a whole: numba makes arrays for the results."""
    return _compiled(function, no_cpython_wrapper=True)


def allocating(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that return arrays of their own: called once in a block, not in each sample."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def part(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, and cached by itself, so that a process of its own can compile it (``compile_part``)."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True, _nrt=False, cache=True)


def compile_part(function: Callable[_P, Any], *arguments: _P.args, **_: _P.kwargs) -> None:
    """Compile for arguments of these types, or load from the cache."""
    dispatcher: Any = function
    type_: Any = typeof
    dispatcher.compile(tuple(map(type_, arguments)))


def entry(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile an entry of the kernel: callable from Python, cached on disk, releases the GIL.

    Entries and parts are cached: their machine code contains that of all functions they call.  Caching the inner
    functions as well would cost an eighth of the compile time.
    """
    return _compiled(function, cache=True)


def short_entry(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``entry``, for what takes microseconds and is called for each axis in turn: keeps the GIL.

    Let go and taken back at once, it is never there for a thread that waits for it, as that has to wake up first.
    """
    return _compiled(function, nogil=False, cache=True)
