"""Compiles the kernel in advance, in separate processes, into the cache of the daemon.

Large libraries are imported where they are used, so that these processes can be started before they are loaded.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from service.pipeline.kernel_cache import VARIABLE

if TYPE_CHECKING:
    from monitor_core.monitoring import AxisBatch

_CHILD = """
import gc, os, sys
gc.disable()  # a tenth of the time; the process ends soon
from service.pipeline.warming import HYPOTHESES, compile_kernel, compile_update
if int(sys.argv[1]) == HYPOTHESES:
    os.nice(10)  # the daemon monitors already, and may need the processor
(compile_update if "update" in sys.argv else compile_kernel)(int(sys.argv[1]))
os._exit(0)  # the cache is written; to take the compiler's memory apart would take a second
"""


HYPOTHESES, CYCLIC_CLOCK = 0, -1
"""Instead of a number of axes: the kernel of the multi-model detector; the clock that is fitted to a cycle."""
FEW_AXES = 1
"""What nearly every daemon needs first: a robot has few axes."""
FEW = "few-axes"


def compile_kernel(lanes: int) -> None:
    """Compile the kernel for batches of this number of axes, or load it from its cache; then mark the cache.

    With it what makes samples of frames, which the estimates need, too.
    """
    import numpy as np

    from monitor_core.detection import HypothesisBank
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.sampling import compile_stream
    from monitor_core.settings import Settings

    if lanes == CYCLIC_CLOCK:
        compile_stream(cyclic=True)
    elif lanes == HYPOTHESES:
        bank = HypothesisBank(reference_model(), Settings(interval_s=INTERVAL_S))
        bank.run(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    else:
        empty = np.zeros((0, lanes))
        _batch(lanes).run(np.zeros((0, lanes), np.int64), empty, empty)
        compile_stream()
    if mark := _mark(lanes):
        mark.touch()


def compile_update(lanes: int) -> None:
    """Compile the second half of a sample, then the way from frames to samples.

    This is beside ``compile_kernel``, which then finds both in the cache.
    """
    from monitor_core.sampling import compile_stream

    _batch(lanes).compile_update()
    compile_stream()


def _batch(lanes: int) -> AxisBatch:
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import AxisBatch
    from monitor_core.settings import Settings

    return AxisBatch([reference_model()] * lanes, [Settings(interval_s=INTERVAL_S)] * lanes)


def compile_all() -> None:
    """Compile everything that a daemon may need: few axes, many axes, multi-model detector, cyclic clock."""
    from monitor_core.monitoring import FEWEST_LANES

    for lanes in (FEW_AXES, FEWEST_LANES, HYPOTHESES, CYCLIC_CLOCK):
        compile_kernel(lanes)


class CacheFiller:
    """Compiles the kernel into its cache in separate processes, one for each missing shape, in parallel.

    The memory of the compiler ends with its process: 100 MB that the daemon would otherwise keep.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._children: dict[str, subprocess.Popen[str]] = {}
        self._beside: list[subprocess.Popen[str]] = []
        self._stopped = False

    @property
    def begun(self) -> bool:
        """Whether a process has been started, and no ``stop`` has ended it."""
        return bool(self._children) and not self._stopped

    def begin(self, lanes: Iterable[int]) -> None:
        """Start to fill the cache where it is empty; ``fill`` waits for it.  It ends with the program."""
        atexit.register(self.stop)
        for n in lanes:
            if not _is_cached(n):
                self._start(n)

    def fill(self, lanes: Iterable[int]) -> bool:
        """Fill the cache for batches of these numbers of axes, where it is empty; False when ``stop`` ended that.

        A failure is only logged: the kernel is then compiled where it is called.
        """
        missing = {_shape(n): n for n in lanes if not _is_cached(n)}
        for child in [self._children.get(shape) or self._start(n) for shape, n in missing.items()]:
            if child is not None:
                self._wait(child)
        for beside in self._beside:
            beside.kill()  # what it would compile is there
            beside.wait()
        return not self._stopped

    def stop(self) -> None:
        """End the compilation, if there is one, from another thread."""
        with self._lock:
            self._stopped = True
            for child in (*self._children.values(), *self._beside):
                child.kill()

    def _start(self, lanes: int) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._stopped:
                return None
            try:
                self._children[_shape(lanes)] = child = _compiler(lanes)
                # The cold start of most daemons: from both ends at once.
                if _shape(lanes) == FEW and (os.cpu_count() or 1) > 1:
                    self._beside.append(_compiler(lanes, "update"))
            except OSError as error:
                _warn(str(error))
                return None
            return child

    def _wait(self, child: subprocess.Popen[str]) -> None:
        _, messages = child.communicate()
        if child.returncode != 0 and not self._stopped:
            _warn(messages.strip().rpartition("\n")[2] or f"exit code {child.returncode}")


def _compiler(lanes: int, *what: str) -> subprocess.Popen[str]:
    """A process that compiles.

    It has a group of its own: Ctrl-C is for the daemon, which ends the child itself.  Not a session of its own: Linux
    shares out the processor by sessions first, and "nice" would count for nothing.
    """
    command, null = [sys.executable, "-P", "-c", _CHILD, str(lanes), *what], subprocess.DEVNULL
    return subprocess.Popen(
        command, stdin=null, stdout=null, stderr=null if what else subprocess.PIPE, text=True,
        process_group=0, env=_effort(lanes),
    )  # fmt: skip


def _warn(reason: str) -> None:
    import structlog

    log = structlog.get_logger(__name__)
    log.warning("the kernel could not be compiled in a process of its own", reason=reason)


def _effort(lanes: int) -> dict[str, str]:
    """Environment of the compiling process.

    Few axes are run without SIMD: LLVM's lowest effort, and no search for loops to vectorise, save a fifth of the time
    until the first estimate, and the code is as fast.  The other shapes are slower with it.
    """
    least = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
    return dict(os.environ) | (least if lanes == CYCLIC_CLOCK or _shape(lanes) == FEW else {})


def _is_cached(lanes: int) -> bool:
    """Whether the cache holds this shape of the kernel; for another processor it would not be used."""
    mark = _mark(lanes)
    return mark is not None and mark.exists()


def _mark(lanes: int) -> Path | None:
    """Marker file of a shape: all shapes are in the same cache files of numba."""
    folder = os.environ.get(VARIABLE)
    return Path(folder) / f"{_shape(lanes)}.compiled" if folder else None


def _shape(lanes: int) -> str:
    named = {FEW_AXES: FEW, HYPOTHESES: "hypotheses", CYCLIC_CLOCK: "cyclic-clock"}
    if lanes in named:
        return named[lanes]
    from monitor_core.monitoring import FEWEST_LANES

    return FEW if lanes < FEWEST_LANES else "many-axes"


EARLY = CacheFiller()
"""Of this process, for a start before its libraries are loaded."""
