"""How long the worker takes for a block."""

from bisect import bisect_left

from service.pipeline.snapshot import Histogram

BOUNDS_S = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


class ProcessingTime:
    """A histogram that grows."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_S) + 1)
        self._total_s = 0.0

    def observe(self, duration_s: float) -> None:
        """One block took so long [s]."""
        self._counts[bisect_left(BOUNDS_S, duration_s)] += 1
        self._total_s += duration_s

    def histogram(self) -> Histogram:
        """The histogram now."""
        return Histogram(BOUNDS_S, tuple(self._counts), self._total_s)
