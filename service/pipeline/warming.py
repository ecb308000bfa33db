"""Compile the kernel before anything waits for it."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import structlog

from monitor_core.detection.multimodel.hypothesis_bank import HypothesisBank
from monitor_core.excitation.reference_experiment import INTERVAL_S, reference_model
from monitor_core.monitoring.axis_batch import FEWEST_LANES, Bank
from monitor_core.settings import Settings
from service.pipeline.kernel_cache import VARIABLE

_CHILD = """
import sys
from service.pipeline.warming import compile_kernel
for lanes in sys.argv[1:]:
    compile_kernel(int(lanes))
"""

log = structlog.get_logger(__name__)


HYPOTHESES = 0
"""In place of a number of axes: the kernel of the banks of hypotheses."""


def compile_kernel(lanes: int) -> None:
    """Have the kernel ready for banks of so many axes: compiled, or loaded from its cache, which is marked."""
    if lanes == HYPOTHESES:
        nothing = np.zeros(0)
        HypothesisBank(reference_model(), Settings(interval_s=INTERVAL_S)).run(
            np.zeros(0, np.int64), nothing, nothing
        )
    else:
        bank = Bank([reference_model()] * lanes, [Settings(interval_s=INTERVAL_S)] * lanes)
        bank.run(np.zeros((0, lanes), np.int64), np.zeros((0, lanes)), np.zeros((0, lanes)))
    if mark := _mark(lanes):
        mark.touch()


def compile_all() -> None:
    """All of the kernel: few axes and many, and hypotheses."""
    for lanes in (1, FEWEST_LANES, HYPOTHESES):
        compile_kernel(lanes)


class CacheFiller:
    """Compiles the kernel into its cache in a process of its own.

    What the compiler has taken stays with its process: 100 MB that the daemon would keep for good.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._child: subprocess.Popen[str] | None = None
        self._stopped = False

    def fill(self, lanes: Iterable[int]) -> bool:
        """Fill the cache for banks of so many axes, where it is empty; False when ``stop`` has ended that.

        A failure is only logged: then the kernel will be compiled where it is called.
        """
        missing = [n for n in lanes if not _is_cached(n)]
        if missing:
            self._run([sys.executable, "-P", "-c", _CHILD, *map(str, missing)])
        return not self._stopped

    def stop(self) -> None:
        """End the compilation, if there is one, from another thread."""
        with self._lock:
            self._stopped = True
            if self._child is not None:
                self._child.kill()

    def _run(self, command: list[str]) -> None:
        quiet, pipe = subprocess.DEVNULL, subprocess.PIPE
        try:
            with self._lock:
                if self._stopped:
                    return
                # A session of its own: Ctrl-C is for the daemon, which ends the child itself.
                self._child = subprocess.Popen(
                    command, stdin=quiet, stdout=quiet, stderr=pipe, text=True, start_new_session=True
                )
        except OSError as error:
            _say_failed(str(error))
            return
        _, said = self._child.communicate()
        if self._child.returncode != 0 and not self._stopped:
            _say_failed(said.strip().rpartition("\n")[2] or f"exit code {self._child.returncode}")


def _is_cached(lanes: int) -> bool:
    """Whether the cache holds this shape of the kernel; for another processor it would not be used."""
    mark = _mark(lanes)
    return mark is not None and mark.exists()


def _mark(lanes: int) -> Path | None:
    """The file that says so: all shapes lie in the same files of numba's."""
    folder = os.environ.get(VARIABLE)
    shape = "few-axes" if lanes < FEWEST_LANES else "many-axes"
    shape = "hypotheses" if lanes == HYPOTHESES else shape
    return Path(folder) / f"{shape}.compiled" if folder else None


def _say_failed(reason: str) -> None:
    log.warning("the kernel could not be compiled in a process of its own", reason=reason)
