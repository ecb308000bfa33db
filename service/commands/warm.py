"""``axiswatch warm``: compile everything ahead of the first start."""

from time import perf_counter


def warm() -> None:
    """Compile all numeric code into numba's cache, so that the next start need not.

    That of the daemon, and that of identify and excite. The cache lies below NUMBA_CACHE_DIR if that is set, else in
    ~/.cache/axiswatch. It holds for this version and this kind of processor.
    """
    start = perf_counter()
    from service.commands.warm_offline import compile_offline
    from service.pipeline.warming import compile_all

    compile_all()
    monitoring = perf_counter() - start
    compile_offline()
    print(f"the kernel is ready ({perf_counter() - start:.1f} s, {monitoring:.1f} s of it for the daemon)")
