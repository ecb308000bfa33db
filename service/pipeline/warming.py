"""Compiles the kernel in advance, in separate processes, into the cache of the daemon.

Large libraries are imported where they are used, so that these processes can be started before they are loaded.
"""

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from pathlib import Path

from service.pipeline.kernel_cache import VARIABLE

_CHILD = """
import gc, os, sys
gc.disable()  # a tenth of the time; the process ends soon
from service.pipeline.warming import HYPOTHESES, compile_kernel
if int(sys.argv[1]) == HYPOTHESES:
    os.nice(10)  # the daemon monitors already, and may need the processor
compile_kernel(int(sys.argv[1]))
os._exit(0)  # the cache is written; to take the compiler's memory apart would take a second
"""


HYPOTHESES = 0
"""Instead of a number of axes: the kernel of the multi-model detector."""
FEW_AXES = 1
"""What nearly every daemon needs first: a robot has few axes."""


def compile_kernel(lanes: int) -> None:
    """Compile the kernel for batches of this number of axes, or load it from its cache; then mark the cache."""
    import numpy as np

    from monitor_core.detection import HypothesisBank
    from monitor_core.modeling import INTERVAL_S, reference_model
    from monitor_core.monitoring import AxisBatch
    from monitor_core.settings import Settings

    settings, empty = Settings(interval_s=INTERVAL_S), np.zeros((0, lanes))
    if lanes == HYPOTHESES:
        HypothesisBank(reference_model(), settings).run(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    else:
        bank = AxisBatch([reference_model()] * lanes, [settings] * lanes)
        bank.run(np.zeros((0, lanes), np.int64), empty, empty)
    if mark := _mark(lanes):
        mark.touch()


def compile_all() -> None:
    """Compile all shapes of the kernel: few axes, many axes, multi-model detector."""
    from monitor_core.monitoring import FEWEST_LANES

    for lanes in (FEW_AXES, FEWEST_LANES, HYPOTHESES):
        compile_kernel(lanes)


class CacheFiller:
    """Compiles the kernel into its cache in separate processes, one for each missing shape, in parallel.

    The memory of the compiler ends with its process: 100 MB that the daemon would otherwise keep.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._children: dict[str, subprocess.Popen[str]] = {}
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
        return not self._stopped

    def stop(self) -> None:
        """End the compilation, if there is one, from another thread."""
        with self._lock:
            self._stopped = True
            for child in self._children.values():
                child.kill()

    def _start(self, lanes: int) -> subprocess.Popen[str] | None:
        command, null = [sys.executable, "-P", "-c", _CHILD, str(lanes)], subprocess.DEVNULL
        with self._lock:
            if self._stopped:
                return None
            try:
                # A group of its own: Ctrl-C is for the daemon, which ends the child itself.  Not a session of its own:
                # Linux shares out the processor by sessions first, and "nice" would count for nothing.
                child = subprocess.Popen(
                    command, stdin=null, stdout=null, stderr=subprocess.PIPE, text=True,
                    process_group=0, env=_effort(lanes),
                )  # fmt: skip
            except OSError as error:
                _warn(str(error))
                return None
            self._children[_shape(lanes)] = child
            return child

    def _wait(self, child: subprocess.Popen[str]) -> None:
        _, messages = child.communicate()
        if child.returncode != 0 and not self._stopped:
            _warn(messages.strip().rpartition("\n")[2] or f"exit code {child.returncode}")


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
    return dict(os.environ) | (least if _shape(lanes) == "few-axes" else {})


def _is_cached(lanes: int) -> bool:
    """Whether the cache holds this shape of the kernel; for another processor it would not be used."""
    mark = _mark(lanes)
    return mark is not None and mark.exists()


def _mark(lanes: int) -> Path | None:
    """Marker file of a shape: all shapes are in the same cache files of numba."""
    folder = os.environ.get(VARIABLE)
    return Path(folder) / f"{_shape(lanes)}.compiled" if folder else None


def _shape(lanes: int) -> str:
    if lanes in (FEW_AXES, HYPOTHESES):
        return "hypotheses" if lanes == HYPOTHESES else "few-axes"
    from monitor_core.monitoring import FEWEST_LANES

    return "few-axes" if lanes < FEWEST_LANES else "many-axes"


EARLY = CacheFiller()
"""Of this process, for a start before its libraries are loaded."""
