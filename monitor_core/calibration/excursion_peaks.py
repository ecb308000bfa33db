"""The highest excursions of g of each hypothesis of a bank, which tell its tail.

They are found piece by piece along g, over all copies of the records; only a limited number is kept.
"""

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.excursions import ORIGIN, PEAK, PLACE, START, excursion_peaks

TOP = 500
"""Number of highest excursions that are used: lower ones have another distribution than the tail."""
LEAST_HEIGHT = 2.0
"""Lower excursions are left out: they say nothing about the tail."""


class ExcursionPeaks:
    """Peaks of the excursions of g of all hypotheses, collected piece by piece over copies of records."""

    def __init__(self, many: int) -> None:
        self._least = np.full(many, LEAST_HEIGHT)
        self._largest: list[Floats] = [np.empty(0) for _ in range(many)]
        self._times: list[Ints] = [np.empty((4, 0), np.int64) for _ in range(many)]
        self._top, self._now = np.zeros(many), np.zeros((4, many), np.int64)
        self.largest = np.zeros(many)
        self.samples = 0
        """Tested ones."""

    def course(self) -> tuple[Floats, Ints]:
        """State of a new course of g, to be given to ``take`` with each of its pieces."""
        return np.zeros_like(self._top), np.zeros_like(self._now)

    def take(self, g: Floats, clock: int, place: Ints, origin: Ints, going_on: tuple[Floats, Ints]) -> None:
        """Add g (N, H) from time ``clock`` [samples] on, with the blocks of its motion and innovations (N,)."""
        N, many = g.shape
        self.largest = np.maximum(self.largest, g.max(axis=0, initial=0.0))
        largest, times = np.empty((many, N // 2 + 1)), np.empty((4, many, N // 2 + 1), np.int64)
        found = np.zeros(many, np.int64)
        g = np.ascontiguousarray(g)
        excursion_peaks(g, clock, place, origin, self._least, *going_on, largest, times, found)
        for i in np.flatnonzero(found):
            self._keep(int(i), largest[i, : found[i]], times[:, i, : found[i]])

    def _keep(self, i: int, largest: Floats, times: Ints) -> None:
        self._largest[i] = np.append(self._largest[i], largest)
        self._times[i] = np.concatenate([self._times[i], times], axis=1)
        if len(self._largest[i]) > 2 * TOP:
            order = np.argsort(self._largest[i])[: -TOP - 2 : -1]
            self._largest[i], self._times[i] = self._largest[i][order], self._times[i][:, order]
            self._least[i] = self._largest[i][-1]

    def highest(self, i: int) -> tuple[float, Floats, Ints]:
        """The highest excursions of hypothesis i.

        Returns the level that they exceed, by how much (n,), falling, and place and origin of the peaks (2, n).
        """
        order = np.argsort(self._largest[i])[::-1]
        base = float(self._largest[i][order[TOP]]) if len(order) > TOP else LEAST_HEIGHT
        return base, self._largest[i][order[:TOP]] - base, self._times[i][[PLACE, ORIGIN]][:, order[:TOP]]

    def events(self, i: int, many: int) -> Floats:
        """First sample, and the sample at which they reach the lowest of them (2, n), of the highest excursions.

        The latter is interpolated from the peak, as if g rose linearly.
        """
        order = np.argsort(self._largest[i])[::-1][:many]
        heights, times = self._largest[i][order], self._times[i][:, order]
        share = heights[-1:] / heights
        return np.stack([times[START], times[START] + share * (times[PEAK] - times[START])])
