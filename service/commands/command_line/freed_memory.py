"""Returns the memory of large arrays to the system as soon as they are freed."""

import ctypes
import platform

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES, _KEPT_BYTES = 4 << 20, 32 << 20


def return_freed_memory() -> None:
    """Let the C library give back each array of four megabytes or more, from now on: those of half a million samples.

    The GNU one would raise that size to 32 MB by itself.  Smaller arrays are between others that are still used, so the
    memory of those in between is not given back: the commissioning of an hour of samples would take half as much again.
    But an array that is given back is fetched again, page by page: with one megabyte, a record of 150 000 samples took
    twice as long.  Other libraries are left as they are.
    """
    if platform.libc_ver()[0] == "glibc":
        library = ctypes.CDLL(None)
        library.mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
        library.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)  # else it would fetch and return its last pages all the time
