"""Cache of the compiled kernel: a separate folder for each version and place of the kernel's sources.

Numba compares only the file of the called function, not the files of those it calls in turn.  After an upgrade that
changed one of these it would run the old code.  Hence the hash of the sources in the name of the folder.  Numba also
finds what it compiled by the path of the source and by its own version: were these not in the name, what marks a
kernel as compiled would count for a second installation too, which would then compile while it monitors.
"""

import atexit
import hashlib
import importlib.metadata
import os
import shutil
import sys
import tempfile
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
COMPILED = tuple(Path(__file__).parents[2] / "monitor_core" / name for name in ("kernel", "sampling"))
"""Folders with compiled functions of the daemon"""


def choose(environ: MutableMapping[str, str]) -> Path:
    """Set numba's cache folder and effort; to be called before anything imports numba.

    The folder lies below NUMBA_CACHE_DIR if that is set, otherwise below the user's cache folder.  Where it cannot be
    written it is a temporary folder: numba uses none that it cannot write to.  That has links to the files of the
    wanted one, as an image ships them; where there are none, it is reported that every start compiles.
    """
    folder = _base(environ) / f"kernel-{fingerprint()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        folder = _folder_of_this_run(folder, error)
    environ[VARIABLE] = str(folder)
    # Compiles a tenth faster than numba's default of 3; the code is as fast.
    environ.setdefault("NUMBA_OPT", "2")
    return folder


def fingerprint() -> str:
    """Hash of what the compiled kernel depends on: its sources, where they are, and numba's version."""
    digest = hashlib.sha256(importlib.metadata.version("numba").encode())
    for source in sorted(source for folder in COMPILED for source in folder.glob("*.py")):
        digest.update(b"\0" + os.fsencode(source) + b"\0" + source.read_bytes())
    return digest.hexdigest()[:12]


def _base(environ: MutableMapping[str, str]) -> Path:
    if given := environ.get(VARIABLE):
        # The parent process has set the folder already.
        return Path(given).parent if Path(given).name.startswith("kernel-") else Path(given)
    return Path(environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache") / "axiswatch"


def _folder_of_this_run(wanted: Path, error: OSError) -> Path:
    # Processes that this one starts find a name as ``_base`` knows it.
    folder = Path(tempfile.mkdtemp(prefix="axiswatch-")) / wanted.name
    atexit.register(shutil.rmtree, folder.parent, ignore_errors=True)
    if _linked(wanted, folder):
        return folder
    print(
        f"axiswatch: the compiled kernel cannot be kept in {wanted} ({error.strerror}), so every start "
        f"compiles it again: set {VARIABLE} to a folder that can be written to",
        file=sys.stderr,
    )
    return folder


def _linked(shipped: Path, folder: Path) -> bool:
    """Make the folder, with links to all files of the other one if they can be read; whether there are any."""
    folder.mkdir()
    try:
        for file in (path for path in shipped.rglob("*") if path.is_file() and os.access(path, os.R_OK)):
            link = folder / file.relative_to(shipped)
            link.parent.mkdir(exist_ok=True)
            link.symlink_to(file.absolute())
    except OSError:  # it may not be looked at
        pass
    return any(folder.iterdir())
