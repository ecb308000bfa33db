"""Returns the memory of large arrays to the system as soon as they are freed."""

import ctypes
import platform

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES, _KEPT_BYTES = 1 << 20, 32 << 20


def return_freed_memory() -> None:
    """Let the C library give back each array of a megabyte or more, from now on.

    The GNU one would raise that size to 32 MB by itself.  Smaller arrays are between others that are still used, so the
    memory of those in between is not given back: the commissioning of an hour of samples would take half as much again.
    Other libraries are left as they are.
    """
    if platform.libc_ver()[0] == "glibc":
        library = ctypes.CDLL(None)
        library.mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
        library.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)  # else it would fetch and return its last pages all the time
