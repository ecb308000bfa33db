"""Where the compiled kernel is kept: a folder of its own for each version of the kernel's sources.

Numba compares only the file of the function that is called, not the files of those it calls in turn, so after an
upgrade that changed one of these it would go on running the old code.  Hence the sources' hash in the folder's name.
"""

import atexit
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
KERNEL = Path(__file__).parents[2] / "monitor_core" / "kernel"


def choose(environ: MutableMapping[str, str]) -> Path:
    """Set numba's cache folder and effort; call it before anything imports numba.

    It lies below NUMBA_CACHE_DIR if that is set, else below the user's cache folder; where neither can be written to
    it is a folder of this run, and that is said: without one numba refuses to import the kernel.
    """
    folder = _base(environ) / f"kernel-{fingerprint()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        folder = _folder_of_this_run(folder, error)
    environ[VARIABLE] = str(folder)
    environ.setdefault("NUMBA_OPT", "2")  # compiles a tenth faster than numba's own 3, into code as fast
    return folder


def fingerprint() -> str:
    """Hash of the kernel's sources."""
    digest = hashlib.sha256()
    for source in sorted(KERNEL.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:12]


def _base(environ: MutableMapping[str, str]) -> Path:
    if given := environ.get(VARIABLE):
        # A parent process of ours has been here: its folder is already below the base.
        return Path(given).parent if Path(given).name.startswith("kernel-") else Path(given)
    return Path(environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache") / "axiswatch"


def _folder_of_this_run(wanted: Path, error: OSError) -> Path:
    folder = tempfile.mkdtemp(prefix="axiswatch-kernel-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    print(
        f"axiswatch: the compiled kernel cannot be kept in {wanted} ({error.strerror}), so every start "
        f"compiles it again: set {VARIABLE} to a folder that can be written to",
        file=sys.stderr,
    )
    return Path(folder)
