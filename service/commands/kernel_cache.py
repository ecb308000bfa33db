"""A place for the compiled kernel where numba finds none."""

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"


def find_place(environ: MutableMapping[str, str], usual: Iterable[Path]) -> None:
    """Set the folder of the cache where none is set and none of the usual ones can be written to.

    Without one numba refuses to import the kernel.  It is a folder of this run: the next start compiles again.
    """
    if environ.get(VARIABLE) or any(os.access(folder, os.W_OK) for folder in usual):
        return
    environ[VARIABLE] = folder = tempfile.mkdtemp(prefix="axiswatch-kernel-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    print(
        f"axiswatch: no folder for the compiled kernel, it is compiled at every start: set {VARIABLE}",
        file=sys.stderr,
    )


def usual_places() -> tuple[Path, Path]:
    """Beside the sources, and in the user's home."""
    return Path(__file__).parents[2] / "monitor_core" / "kernel", Path(os.path.expanduser("~"))
