"""``axiswatch warm``: compile the kernel ahead of the first start."""

from time import perf_counter


def warm() -> None:
    """Compile the numeric kernel into numba's cache, so that the next start need not.

    The cache lies below NUMBA_CACHE_DIR if that is set, else in ~/.cache/axiswatch. It holds for this version and
    this kind of processor.
    """
    start = perf_counter()
    from service.monitoring.warming import compile_all

    compile_all()
    print(f"the kernel is ready ({perf_counter() - start:.1f} s)")
