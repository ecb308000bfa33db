"""The cache of the compiled kernel, and processes that compile the kernel into it in advance.

Large libraries are imported where they are used, so that these processes can be started before they are loaded.

The cache has a separate folder for each version and place of the kernel's sources.  Numba compares only the file of the
called function, not the files of those it calls in turn.  After an upgrade that changed one of these it would run the
old code.  Hence the hash of the sources in the name of the folder.  Numba also finds what it compiled by the path of
the source and by its own version: were these not in the name, what marks a kernel as compiled would count for a second
installation too, which would then compile while it monitors.
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


_CHILD = """
import gc, sys
gc.disable()  # a tenth of the time; the process ends soon
from service.pipeline.warming import Shape, compile_for_parent
compile_for_parent(Shape(sys.argv[1]))
"""


class Shape(StrEnum):
    """What is compiled at once; the value is the name of its marker file."""

    FEW_AXES = "few-axes"  # what nearly every daemon needs first: a robot has few axes
    MANY_AXES = "many-axes"
    MULTIMODEL = "multi-model"
    CYCLIC_CLOCK = "cyclic-clock"  # the clock that is fitted to a cycle


def batch_shape(lanes: int) -> Shape:
    """The kernel that runs a batch of this number of axes."""
    from monitor_core.monitoring import FEWEST_LANES

    return Shape.FEW_AXES if lanes < FEWEST_LANES else Shape.MANY_AXES


def compile_kernel(shape: Shape) -> None:
    """Compile this shape of the kernel, or load it from its cache; then mark the cache.

    With the kernel of axes what makes samples of frames, which the estimates need, too.
    """
    import numpy as np

    from monitor_core.detection import HypothesisBank
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import FEWEST_LANES
    from monitor_core.samples import concatenate
    from monitor_core.sampling import compile_stream
    from monitor_core.settings import Settings

    if shape == Shape.CYCLIC_CLOCK:
        compile_stream(cyclic=True)
    elif shape == Shape.MULTIMODEL:
        bank = HypothesisBank(reference_model(), Settings(interval_s=INTERVAL_S))
        bank.run(concatenate([]))
    else:
        lanes = 1 if shape == Shape.FEW_AXES else FEWEST_LANES
        empty = np.zeros((0, lanes))
        _batch(lanes).run(np.zeros((0, lanes), np.int64), empty, empty)
        compile_stream()
    if mark := _mark(shape):
        mark.touch()


def compile_parts() -> None:
    """Compile parts of the kernel of few axes, then the way from frames to samples.

    This is beside ``compile_kernel``, which then finds both in the cache.
    """
    from monitor_core.sampling import compile_stream

    _batch(1).compile_parts()
    compile_stream()


def compile_for_parent(shape: Shape) -> NoReturn:
    """What a process does that fills the cache for its parent, the daemon.

    The cold start of most daemons, the kernel of few axes, is compiled from both ends at once if there are processors
    for it: by this process and by a copy of it, which need not import numba again.
    """
    copy = False
    if shape == Shape.MULTIMODEL:
        os.nice(10)  # the daemon monitors already, and may need the processor
    elif shape == Shape.FEW_AXES and (os.cpu_count() or 1) > 1:
        _batch(1)  # all that both need is imported
        copy = os.fork() == 0
    if copy:  # the parent reads to the end of what the other one says
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_parts() if copy else compile_kernel(shape)
    os._exit(0)  # the cache is written; to take the compiler's memory apart would take a second


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def _batch(lanes: int) -> AxisBatch:
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import AxisBatch
    from monitor_core.settings import Settings

    return AxisBatch([reference_model()] * lanes, [Settings(interval_s=INTERVAL_S)] * lanes)


def compile_all() -> None:
    """Compile everything that a daemon may need."""
    for shape in Shape:
        compile_kernel(shape)


class CacheFiller:
    """Compiles the kernel into its cache in separate processes, one for each missing shape, in parallel.

    The memory of the compiler ends with its process: 100 MB that the daemon would otherwise keep.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._children: dict[Shape, subprocess.Popen[str]] = {}
        self._stopped = False

    @property
    def begun(self) -> bool:
        """Whether a process has been started, and no ``stop`` has ended it."""
        return bool(self._children) and not self._stopped

    def begin(self, shape: Shape) -> None:
        """Start to fill the cache where it is empty; ``fill`` waits for it.  It ends with the program."""
        atexit.register(self.stop)
        if not _is_cached(shape):
            self._start(shape)

    def fill(self, shapes: Collection[Shape]) -> bool:
        """Fill the cache with these shapes, where it is empty; False when ``stop`` ended that.

        A failure is only logged: the kernel is then compiled where it is called.
        """
        missing = [shape for shape in Shape if shape in shapes and not _is_cached(shape)]
        for child in [self._children.get(shape) or self._start(shape) for shape in missing]:
            if child is not None:
                self._wait(child)
        return not self._stopped

    def stop(self) -> None:
        """End the compilation, if there is one, from another thread."""
        with self._lock:
            self._stopped = True
            for child in self._children.values():
                child.kill()
                if child.stdin:
                    child.stdin.close()  # ends its copy

    def _start(self, shape: Shape) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._stopped:
                return None
            try:
                self._children[shape] = child = _compiler(shape)
            except OSError as error:
                _warn(str(error))
                return None
            return child

    def _wait(self, child: subprocess.Popen[str]) -> None:
        with child:
            messages = child.stderr.read() if child.stderr else ""
        if child.returncode != 0 and not self._stopped:
            _warn(messages.strip().rpartition("\n")[2] or f"exit code {child.returncode}")


def _compiler(shape: Shape) -> subprocess.Popen[str]:
    """A process that compiles.

    It has a group of its own: Ctrl-C is for the daemon, which ends the child itself.  Not a session of its own: Linux
    shares out the processor by sessions first, and "nice" would count for nothing.  A parent that is killed ends it,
    and its copy, by closing its standard input.
    """
    command, pipe = [sys.executable, "-P", "-c", _CHILD, shape], subprocess.PIPE
    return subprocess.Popen(
        command,
        stdin=pipe,
        stdout=subprocess.DEVNULL,
        stderr=pipe,
        text=True,
        process_group=0,
        env=_effort(shape),
    )


def _warn(reason: str) -> None:
    import structlog

    log = structlog.get_logger(__name__)
    log.warning("the kernel could not be compiled in a process of its own", reason=reason)


def _effort(shape: Shape) -> dict[str, str]:
    """Environment of the compiling process.

    Few axes are run without SIMD: LLVM's lowest effort, and no search for loops to vectorise, save a fifth of the time
    until the first estimate, and the code is as fast.  The other shapes are slower with it.
    """
    least = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
    return dict(os.environ) | (least if shape in (Shape.CYCLIC_CLOCK, Shape.FEW_AXES) else {})


def _is_cached(shape: Shape) -> bool:
    """Whether the cache holds this shape of the kernel; for another processor it would not be used."""
    mark = _mark(shape)
    return mark is not None and mark.exists()


def _mark(shape: Shape) -> Path | None:
    """Marker file of a shape: all shapes are in the same cache files of numba."""
    folder = os.environ.get(VARIABLE)
    return Path(folder) / f"{shape}.compiled" if folder else None


EARLY = CacheFiller()
"""Of this process, for a start before its libraries are loaded."""
