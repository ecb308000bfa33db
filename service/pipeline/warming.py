"""Compiles the kernel in advance, in separate processes, into the cache of the daemon.

Large libraries are imported where they are used, so that these processes can be started before they are loaded.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Collection
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from service.pipeline.kernel_cache import VARIABLE

if TYPE_CHECKING:
    from monitor_core.monitoring import AxisBatch

_CHILD = """
import gc, os, sys, threading
threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()  # its end: the parent has ended
gc.disable()  # a tenth of the time; the process ends soon
from service.pipeline.warming import Shape, compile_kernel, compile_parts
shape = Shape(sys.argv[1])
if shape == Shape.MULTIMODEL:
    os.nice(10)  # the daemon monitors already, and may need the processor
compile_parts() if "parts" in sys.argv else compile_kernel(shape)
os._exit(0)  # the cache is written; to take the compiler's memory apart would take a second
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
        self._beside: list[subprocess.Popen[str]] = []
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
        for beside in self._beside:
            with beside:
                beside.kill()  # what it would compile is there
        return not self._stopped

    def stop(self) -> None:
        """End the compilation, if there is one, from another thread."""
        with self._lock:
            self._stopped = True
            for child in (*self._children.values(), *self._beside):
                child.kill()

    def _start(self, shape: Shape) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._stopped:
                return None
            try:
                # The cold start of most daemons: from both ends at once; first the process that has to be in time.
                if shape == Shape.FEW_AXES and (os.cpu_count() or 1) > 1:
                    self._beside.append(_compiler(shape, "parts"))
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


def _compiler(shape: Shape, *what: str) -> subprocess.Popen[str]:
    """A process that compiles.

    It has a group of its own: Ctrl-C is for the daemon, which ends the child itself.  Not a session of its own: Linux
    shares out the processor by sessions first, and "nice" would count for nothing.  A parent that is killed ends it by
    closing its standard input.
    """
    command, null = [sys.executable, "-P", "-c", _CHILD, shape, *what], subprocess.DEVNULL
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=null, stderr=null if what else subprocess.PIPE, text=True,
        process_group=0, env=_effort(shape),
    )  # fmt: skip


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
