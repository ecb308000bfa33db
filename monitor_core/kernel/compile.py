"""How the functions of the kernel are compiled.

Only ``entry``, ``array_function`` and ``allocating`` functions count references to arrays.  All others use the arrays
that they are given: without counting, a named tuple of arrays costs no more as an argument than each array by itself,
so what travels together is one argument, and there is less to compile.  They must not make or return arrays.

Functions that only other compiled functions call are linked into them, and optimised and made machine code only there
(``_Linked``).  Numba by itself would do both for each of them, too, in a tenth of the compile time, for nothing.

No fast-math: one axis and many axes give the same bits.  Division as in numpy: a test for zero would prevent SIMD.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from llvmlite import binding as llvm
from numba import njit, typeof
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

# Most loops run over a few states, parameters or entries of A.  LLVM would repeat their bodies eight times for long
# runs that never come: the code would be twice as long and no faster, and compiling would take a quarter longer.
llvm.set_option("axiswatch", "-unroll-runtime=false")

_P = ParamSpec("_P")
_R = TypeVar("_R")


class _NoEnvironment:
    """Takes the place of the code generator where numba hands over the environment of a Python function."""

    def set_env(self, name: str, environment: object) -> None:
        """Nothing: the environment is for calls from Python."""


class _LinkedCode(JITCodeLibrary):
    """Code of a function that only other compiled functions call: theirs is made machine code."""

    codegen = _NoEnvironment()

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002  # numba names it
        finalize: Any = self._ensure_finalized
        finalize()
        return 0  # as numba's for a function that Python cannot call

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


_register: Any = register_pass


@_register(mutates_CFG=True, analysis_only=False)
class _LinkedLowering(NativeLowering):
    _name = "axiswatch_linked_lowering"

    def run_pass(self, state: Any) -> bool:
        library: Any = _LinkedCode
        lower: Any = super().run_pass
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(lower(state))


class _Linked(CompilerBase):
    """Numba's own passes, but ``_LinkedCode``."""

    def define_pipelines(self) -> list[Any]:
        builder: Any = DefaultPassBuilder
        manager = builder.define_nopython_pipeline(self.state)
        manager.passes = [
            (_LinkedLowering if pass_ is NativeLowering else pass_, text) for pass_, text in manager.passes
        ]
        manager.finalize()
        return [manager]


def _compiled(function: Callable[_P, _R], **options: Any) -> Callable[_P, _R]:
    # Unused wrappers would cost a third of the compile time; numba's type hints lack these options.
    compile_: Any = njit
    decorator = compile_(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)
    return cast("Callable[_P, _R]", decorator(function))


def _linked(function: Callable[_P, _R], **options: bool) -> Callable[_P, _R]:
    return _compiled(function, no_cpython_wrapper=True, pipeline_class=_Linked, **options)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a piece of the kernel that is called only by other pieces, never from Python.

    It is inlined into its callers: each array that is passed to a call costs seven words on the stack, and a sample
    passes hundreds of arrays.
    """
    return _linked(function, forceinline=True, _nrt=False)


def outlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that are called seldom or are long: compiled once, not into every caller."""
    return _linked(function, _nrt=False)


def array_function(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``outlined``, for functions that calculate with arrays as a whole: numba makes arrays for the results."""
    return _linked(function)


def allocating(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that return arrays of their own: called once in a block, not in each sample."""
    return _linked(function, forceinline=True)


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
