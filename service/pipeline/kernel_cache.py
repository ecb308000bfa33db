"""The cache of the compiled kernel, and processes that compile the kernel into the cache in advance.

Large libraries are imported inside functions, so that these processes can start before the libraries are loaded.

The cache has a separate folder for each version and location of the kernel's sources.  Numba checks only the file of
the called function, not the files of the functions that it calls in turn.  After an upgrade that changes only one of
these, numba would run the old code.  So the folder's name has a hash of all sources.  Numba also looks up its compiled
code by the path of the source and by its own version.  These are part of the hash, too: otherwise the marker files of
one installation would also count for a second one, which would then compile while it monitors.
"""

from __future__ import annotations

import atexit
import hashlib
import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Collection, MutableMapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from monitor_core.monitoring import AxisBatch


VARIABLE = "NUMBA_CACHE_DIR"
COMPILED = tuple(Path(__file__).parents[2] / "monitor_core" / name for name in ("kernel", "sampling"))
"""Folders of the functions that numba compiles for the daemon"""


def choose(environ: MutableMapping[str, str]) -> Path:
    """Set numba's cache folder and optimisation level; to be called before anything imports numba.

    The folder lies below NUMBA_CACHE_DIR if that is set, otherwise below the user's cache folder.  Numba uses no folder
    that it cannot write to.  So if the folder is read-only, a temporary folder is used, with links to the files of the
    first one, as a container image ships them.  If it has no files, a message says that every start compiles.
    """
    folder = _base(environ) / f"kernel-{fingerprint()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        folder = _temporary_folder(folder, error)
    environ[VARIABLE] = str(folder)
    # Compiles a tenth faster than numba's default of 3; the code is as fast.
    environ.setdefault("NUMBA_OPT", "2")
    return folder


def fingerprint() -> str:
    """Hash of all that the compiled kernel depends on: its sources, their paths, and numba's version."""
    digest = hashlib.sha256(importlib.metadata.version("numba").encode())
    for source in sorted(source for folder in COMPILED for source in folder.glob("*.py")):
        digest.update(b"\0" + os.fsencode(source) + b"\0" + source.read_bytes())
    return digest.hexdigest()[:12]


def _base(environ: MutableMapping[str, str]) -> Path:
    if given := environ.get(VARIABLE):
        # A parent process has already set the folder.
        return Path(given).parent if Path(given).name.startswith("kernel-") else Path(given)
    return Path(environ.get("XDG_CACHE_HOME") or Path(os.path.expanduser("~")) / ".cache") / "axiswatch"


def _temporary_folder(wanted: Path, error: OSError) -> Path:
    # Keep the folder's name, by which ``_base`` recognises it in child processes.
    folder = Path(tempfile.mkdtemp(prefix="axiswatch-")) / wanted.name
    atexit.register(shutil.rmtree, folder.parent, ignore_errors=True)
    if _link_files(wanted, folder):
        return folder
    print(
        f"axiswatch: the compiled kernel cannot be kept in {wanted} ({error.strerror}), so every start "
        f"compiles it again: set {VARIABLE} to a folder that can be written to",
        file=sys.stderr,
    )
    return folder


def _link_files(shipped: Path, folder: Path) -> bool:
    """Make the folder with links to all readable files of ``shipped``; returns whether there are any."""
    folder.mkdir()
    try:
        for file in (path for path in shipped.rglob("*") if path.is_file() and os.access(path, os.R_OK)):
            link = folder / file.relative_to(shipped)
            link.parent.mkdir(exist_ok=True)
            link.symlink_to(file.absolute())
    except OSError:  # the folder cannot be listed
        pass
    return any(folder.iterdir())


_CHILD = """
import gc, sys
gc.disable()  # saves a tenth of the time; the process ends soon
from service.pipeline.kernel_cache import KernelShape, compile_for_parent
compile_for_parent(KernelShape(sys.argv[1]))
"""


class KernelShape(StrEnum):
    """A part of the kernel that is compiled in one step; the value is the name of its marker file."""

    FEW_AXES = "few-axes"  # nearly every daemon needs this first, as a robot has few axes
    MANY_AXES = "many-axes"
    MULTIMODEL = "multi-model"
    CYCLIC_CLOCK = "cyclic-clock"  # the clock model for samples on a fixed cycle


def batch_shape(lanes: int) -> KernelShape:
    """The kernel for a batch of this number of axes."""
    from monitor_core.monitoring import FEWEST_LANES

    return KernelShape.FEW_AXES if lanes < FEWEST_LANES else KernelShape.MANY_AXES


def compile_kernel(shape: KernelShape) -> None:
    """Compile this shape of the kernel, or load it from the cache; then write its marker file.

    Shapes for axes include the functions that make samples from frames, as the estimates need these, too.
    """
    import numpy as np

    from monitor_core.detection import HypothesisBank
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import FEWEST_LANES
    from monitor_core.samples import concatenate
    from monitor_core.sampling import compile_stream
    from monitor_core.settings import Settings

    if shape == KernelShape.CYCLIC_CLOCK:
        compile_stream(cyclic=True)
    elif shape == KernelShape.MULTIMODEL:
        bank = HypothesisBank(reference_model(), Settings(interval_s=INTERVAL_S))
        bank.run(concatenate([]))
    else:
        lanes = 1 if shape == KernelShape.FEW_AXES else FEWEST_LANES
        empty = np.zeros((0, lanes))
        _batch(lanes).run(np.zeros((0, lanes), np.int64), empty, empty)
        compile_stream()
    if marker := _marker(shape):
        marker.touch()


def compile_parts() -> None:
    """Compile parts of the kernel of few axes, then the functions that make samples from frames.

    This runs at the same time as ``compile_kernel``, which then finds both in the cache.
    """
    from monitor_core.sampling import compile_stream

    _batch(1).compile_parts()
    compile_stream()


def compile_for_parent(shape: KernelShape) -> NoReturn:
    """Fill the cache for the parent process, the daemon; then end this process.

    Most daemons need the kernel of few axes at a cold start.  If there is a second processor, this process compiles the
    kernel from one end and a fork of it from the other; the fork need not import numba again.
    """
    is_fork = False
    if shape == KernelShape.MULTIMODEL:
        os.nice(10)  # the daemon monitors already, and may need the processor
    elif shape == KernelShape.FEW_AXES and (os.cpu_count() or 1) > 1:
        _batch(1)  # imports all that both processes need
        is_fork = os.fork() == 0
    if is_fork:  # close its stderr: the parent reads until the original process has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_parts() if is_fork else compile_kernel(shape)
    os._exit(0)  # the cache is written; a normal exit would take a second to free the compiler's memory


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def _batch(lanes: int) -> AxisBatch:
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import AxisBatch
    from monitor_core.settings import Settings

    return AxisBatch([reference_model()] * lanes, [Settings(interval_s=INTERVAL_S)] * lanes)


def compile_all() -> None:
    """Compile all shapes."""
    for shape in KernelShape:
        compile_kernel(shape)


class CacheFiller:
    """Compiles the kernel into its cache, in one process for each missing shape, in parallel.

    The compiler's memory (100 MB) ends with its process; otherwise the daemon would keep it.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._children: dict[KernelShape, subprocess.Popen[str]] = {}
        self._stopped = False

    @property
    def begun(self) -> bool:
        """Whether a process has been started and not been stopped."""
        return bool(self._children) and not self._stopped

    def begin(self, shape: KernelShape) -> None:
        """Start to compile a shape that is not cached; ``fill`` waits for it.  The process ends with the program."""
        atexit.register(self.stop)
        if not _is_cached(shape):
            self._start(shape)

    def fill(self, shapes: Collection[KernelShape]) -> bool:
        """Compile those of the shapes that are not cached; returns False if ``stop`` ended that.

        A failure is only logged: the kernel is then compiled when it is first called.
        """
        missing = [shape for shape in KernelShape if shape in shapes and not _is_cached(shape)]
        for child in [self._children.get(shape) or self._start(shape) for shape in missing]:
            if child is not None:
                self._wait(child)
        return not self._stopped

    def stop(self) -> None:
        """End a running compilation; from another thread."""
        with self._lock:
            self._stopped = True
            for child in self._children.values():
                child.kill()
                if child.stdin:
                    child.stdin.close()  # ends its fork

    def _start(self, shape: KernelShape) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._stopped:
                return None
            try:
                self._children[shape] = child = _start_compiler(shape)
            except OSError as error:
                _warn(str(error))
                return None
            return child

    def _wait(self, child: subprocess.Popen[str]) -> None:
        with child:
            messages = child.stderr.read() if child.stderr else ""
        if child.returncode != 0 and not self._stopped:
            _warn(messages.strip().rpartition("\n")[2] or f"exit code {child.returncode}")


def _start_compiler(shape: KernelShape) -> subprocess.Popen[str]:
    """Start a process that compiles a shape.

    It has its own process group, as Ctrl-C is for the daemon, which ends the child itself.  It has no session of its
    own, as Linux divides processor time between sessions first, so that "nice" would have no effect.  If the parent is
    killed, the end of standard input ends the child and its fork.
    """
    command, pipe = [sys.executable, "-P", "-c", _CHILD, shape], subprocess.PIPE
    return subprocess.Popen(
        command,
        stdin=pipe,
        stdout=subprocess.DEVNULL,
        stderr=pipe,
        text=True,
        process_group=0,
        env=_compiler_environment(shape),
    )


def _warn(reason: str) -> None:
    import structlog

    log = structlog.get_logger(__name__)
    log.warning("the kernel could not be compiled in a separate process", reason=reason)


def _compiler_environment(shape: KernelShape) -> dict[str, str]:
    """Environment of the compiling process, with its optimisation level.

    The kernel of few axes uses no SIMD.  LLVM's lowest optimisation level without loop vectorisation saves a fifth of
    the time until the first estimate, and the code is as fast.  The other shapes would be slower with it.
    """
    least = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
    return dict(os.environ) | (least if shape in (KernelShape.CYCLIC_CLOCK, KernelShape.FEW_AXES) else {})


def _is_cached(shape: KernelShape) -> bool:
    """Whether the cache has this shape of the kernel; numba would not use code of another processor type."""
    marker = _marker(shape)
    return marker is not None and marker.exists()


def _marker(shape: KernelShape) -> Path | None:
    """Marker file of a shape; needed as all shapes share numba's cache files."""
    folder = os.environ.get(VARIABLE)
    return Path(folder) / f"{shape}.compiled" if folder else None


EARLY = CacheFiller()
"""The cache filler of this process, which can start before the large libraries are loaded."""
