"""How the functions of the kernel are compiled.

They take plain arrays, few at a time: a tuple of many arrays as an argument costs more to compile and to pass than the
arithmetic behind it.  No fast-math: the same bits for one axis and for many.  Division as numpy does it: a test for
zero would stop SIMD.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from numba import njit

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _compiled(function: Callable[_P, _R], **options: bool) -> Callable[_P, _R]:
    # The wrappers that nobody calls cost a third of the compile time; numba's types do not know their options.
    compile_: Any = njit
    decorator = compile_(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)
    return cast("Callable[_P, _R]", decorator(function))


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a piece of the kernel; it is called by other pieces only, never from Python.

    It becomes part of its callers: each array that is passed would cost seven words on the stack and, as some caller
    must hold it meanwhile, two atomic operations, and a sample passes hundreds.
    """
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def outlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for what is called seldom or is long beside its call: compiled once, not in every caller."""
    return _compiled(function, no_cpython_wrapper=True)


def entry(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile an entry of the kernel: callable from Python, cached on disk, releases the GIL.

    Only entries are cached: their machine code contains that of all functions they call.  Caching those as well would
    cost an eighth of the compile time.
    """
    return _compiled(function, cache=True)
