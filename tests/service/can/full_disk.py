"""A disk that takes nothing more, for a file that this process has open."""

import os
from pathlib import Path


def fill_the_disk(path: Path) -> int:
    """From now on what is written into this open file is refused; its descriptor."""
    (descriptor,) = (int(link.name) for link in Path("/proc/self/fd").iterdir() if link.resolve() == path.resolve())
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, descriptor)
    os.close(full)
    return descriptor
