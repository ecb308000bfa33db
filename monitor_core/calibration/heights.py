"""The highest excursions of each hypothesis of a bank, which tell its tail.

They are found in pieces of the course of g, over as many copies of records as there are, and only so many are kept.
"""

import numpy as np
from numpy.typing import NDArray

from monitor_core.arrays import Floats
from monitor_core.kernel.heights import ORIGIN, PEAK, PLACE, START
from monitor_core.kernel.heights import heights as heights_of

TOP = 500
"""Excursions that go highest: of more of them the lower ones tell a shape that the higher ones no longer have."""
LEAST_HEIGHT = 2.0
"""Lower ones do not tell the tail."""


class Heights:
    """Excursions of g of so many hypotheses, from pieces of its course over copies of records."""

    def __init__(self, many: int) -> None:
        self._least = np.full(many, LEAST_HEIGHT)
        self._largest: list[Floats] = [np.empty(0) for _ in range(many)]
        self._times: list[NDArray[np.int64]] = [np.empty((4, 0), np.int64) for _ in range(many)]
        self._top, self._now = np.zeros(many), np.zeros((4, many), np.int64)
        self.largest = np.zeros(many)
        self.samples = 0
        """Tested ones."""

    def course(self) -> tuple[Floats, NDArray[np.int64]]:
        """The excursions of a course that begins; what ``take`` is given with each of its pieces."""
        return np.zeros_like(self._top), np.zeros_like(self._now)

    def take(
        self,
        g: Floats,
        clock: int,
        place: NDArray[np.int64],
        origin: NDArray[np.int64],
        going_on: tuple[Floats, NDArray[np.int64]],
    ) -> None:
        """g (N, H) from the time ``clock`` [samples] on; places of its motion and of its innovations (N,)."""
        N, many = g.shape
        self.largest = np.maximum(self.largest, g.max(axis=0, initial=0.0))
        largest, times = np.empty((many, N // 2 + 1)), np.empty((4, many, N // 2 + 1), np.int64)
        found = np.zeros(many, np.int64)
        g = np.ascontiguousarray(g)
        heights_of(g, clock, place, origin, self._least, *going_on, largest, times, found)
        for i in np.flatnonzero(found):
            self._keep(int(i), largest[i, : found[i]], times[:, i, : found[i]])

    def _keep(self, i: int, largest: Floats, times: NDArray[np.int64]) -> None:
        self._largest[i] = np.append(self._largest[i], largest)
        self._times[i] = np.concatenate([self._times[i], times], axis=1)
        if len(self._largest[i]) > 2 * TOP:
            order = np.argsort(self._largest[i])[: -TOP - 2 : -1]
            self._largest[i], self._times[i] = self._largest[i][order], self._times[i][:, order]
            self._least[i] = self._largest[i][-1]

    def highest(self, i: int) -> tuple[float, Floats, NDArray[np.int64]]:
        """What the highest of hypothesis i exceed; by how much (n,), falling; place and origin of the peaks (2, n)."""
        order = np.argsort(self._largest[i])[::-1]
        base = float(self._largest[i][order[TOP]]) if len(order) > TOP else LEAST_HEIGHT
        return base, self._largest[i][order[:TOP]] - base, self._times[i][[PLACE, ORIGIN]][:, order[:TOP]]

    def events(self, i: int, many: int) -> Floats:
        """First sample, and that where they reach the least high of them (2, n), of so many that go highest.

        Where they reach it is told from their peak, as if they had risen evenly.
        """
        order = np.argsort(self._largest[i])[::-1][:many]
        heights, times = self._largest[i][order], self._times[i][:, order]
        share = heights[-1:] / heights
        return np.stack([times[START], times[START] + share * (times[PEAK] - times[START])])
