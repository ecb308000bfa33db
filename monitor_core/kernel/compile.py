"""Decorators that compile the functions of the kernel.

Only ``entry``, ``array_function`` and ``allocating`` functions count references to arrays.  All others just use the
arrays that they are given.  Without counting, a named tuple of arrays is as cheap an argument as a single array; so
related arrays are passed together, and there is less to compile.  These functions must not create arrays, nor return
arrays to a function that counts.

No fast-math: one axis and many axes give the same bits.  Division as in numpy: a test for zero would prevent SIMD.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

# Numba imports this when something is compiled or loaded for the first time, which adds types to its table of types: a
# call from another thread that looks them up at that moment would fail.
import numba.experimental.function_type  # noqa: F401
from llvmlite import binding as llvm
from numba import njit, typeof
from numba._dynfunc import make_function  # type: ignore[import-not-found]
from numba.core.base import BaseContext
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.typed_passes import NopythonRewrites
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import InlineClosureLikes

# Most loops run over a few states, parameters or entries of A.  LLVM would unroll them eight times for long runs, which
# never occur: the code would be twice as long and no faster, and compilation would take a quarter longer.
llvm.set_option("axiswatch", "-unroll-runtime=false")

_P = ParamSpec("_P")
_R = TypeVar("_R")


# --- Numba's own work, of which a quarter can be saved ---------------------------------------------------------------


def _equal_flags(flags: Any, other: Any) -> bool:
    """Whether two sets of flags are equal; a flag that is not set has its default."""
    own, others, options = flags._values, other._values, flags.options
    return own == others or all(
        own.get(name, options[name].default) == others.get(name, options[name].default)
        for name in own.keys() | others.keys()
    )


# Numba looks its flags up 40 000 times.  Its own hash is that of the names of all options, which is always the same.
TargetConfig.__hash__ = lambda _flags: 0  # type: ignore[method-assign]
TargetConfig.__eq__ = _equal_flags  # type: ignore[method-assign]

_find_signature: Any = BaseFunction.get_call_type
_flags: Any = ConfigStack.top_or_none
_signatures: dict[object, tuple[Any, object]] = {}


def _signature(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """Signature of a function of numba, such as + or min, for arguments of these types; cached."""
    key = function, context, tuple(args), tuple(kws.items()), _flags()
    known = _signatures.get(key)
    if known is None:
        signature = _find_signature(function, context, args, kws)
        known = _signatures[key] = signature, function._impl_keys[signature.args]
    signature, function._impl_keys[signature.args] = known
    return signature


# Numba tries a dozen implementations of each operator and function until one fits.  The kernel has 8000 calls, but only
# 550 of them differ in their types.
BaseFunction.get_call_type = _signature  # type: ignore[assignment, method-assign]

_find_implementation: Any = BaseContext.get_function


def _implementation(context: Any, function: Any, signature: Any, _firstcall: bool = True) -> Any:
    """Generator of the LLVM code of a function of numba for arguments of these types; cached."""
    if function == "__array__":
        raise NotImplementedError
    return _find_implementation(context, function, signature, _firstcall)


# At each use of an array numba looks for a conversion of its type to an array, which is never needed; as it finds none,
# it reads all its registries again.
BaseContext.get_function = _implementation  # type: ignore[method-assign]


class _InnerLibrary(JITCodeLibrary):
    """LLVM code of an inner function: optimised and turned into machine code only as a part of its callers."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self: Any) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _InnerCompiler(Compiler):
    """Compiles an inner function as far as its callers need it.

    A function that creates no arrays is not searched for nested functions, nor for arithmetic with whole arrays.
    """

    def define_pipelines(self) -> Any:
        state, library, base = self.state, cast("Any", _InnerLibrary), cast("Any", super())
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.targetctx = state.targetctx.subtarget(get_executable=_not_executable)
        pipelines = base.define_pipelines()
        for pipeline in pipelines if not state.flags.nrt else ():
            pipeline.passes = [p for p in pipeline.passes if p[0] not in (InlineClosureLikes, NopythonRewrites)]
        return pipelines


def _not_executable(library: JITCodeLibrary, described: Any, environment: object) -> object:
    """Stands for a function that has no machine code."""
    name = described.qualname
    return make_function(described.lookup_module(), name, name, 0, environment, (library,))


# --- The decorators --------------------------------------------------------------------------------------------------


def _compiled(function: Callable[_P, _R], nogil: bool = True, **options: Any) -> Callable[_P, _R]:
    # Unused wrappers would cost a third of the compile time; numba's type hints lack these options.
    compile_: Any = njit
    decorator = compile_(nogil=nogil, error_model="numpy", no_cfunc_wrapper=True, **options)
    return cast("Callable[_P, _R]", decorator(function))


def _inner(function: Callable[_P, _R], **options: bool) -> Callable[_P, _R]:
    return _compiled(function, no_cpython_wrapper=True, pipeline_class=_InnerCompiler, **options)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a piece of the kernel that is called only by other pieces, never from Python.

    It is inlined into its callers: each array that is passed to a call costs seven words on the stack, and a sample
    passes hundreds of arrays.
    """
    return _inner(function, forceinline=True, _nrt=False)


def outlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that are long or rarely called: compiled once, not inlined into each caller."""
    return _inner(function, _nrt=False)


def array_function(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``outlined``, for functions that calculate with whole arrays: numba creates arrays for the results."""
    return _inner(function)


def allocating(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, for functions that return arrays of their own: called once in a block, not in each sample."""
    return _inner(function, forceinline=True)


def part(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """As ``kernel``, and cached separately, so that another process can compile it (``compile_part``)."""
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
    """As ``entry``, for functions that take microseconds and are called for each axis in turn: keeps the GIL.

    A GIL that is released and taken back at once is of no use to a waiting thread, which first has to wake up.
    """
    return _compiled(function, nogil=False, cache=True)
