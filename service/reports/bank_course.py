"""The course of the bank of hypotheses over a record: of each cause the least and the largest g / h, bin by bin."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.detection import HypothesisBank
from service.reports.bins import Counts, joined, known

EITHER = 0
"""The way of a change that has none."""


class Group(NamedTuple):
    """Hypotheses that are drawn as one line: those of a cause, of a parameter those of an increase or of a decrease."""

    cause: str
    way: int
    """1 up, -1 down, 0 either"""


class BankCourse:
    """At each sample the largest g / h of each group counts: an alarm is raised where one of them crosses 1.

    Args:
        bank: of the axis.
        parameters: monitored; their increases and decreases are groups of their own.
        most: bins.
    """

    def __init__(self, bank: HypothesisBank, parameters: Sequence[str], most: int) -> None:
        self._h = bank.h
        of = [_group(one.cause, one.size, parameters) for one in bank.hypotheses]
        self.groups: tuple[Group, ...] = tuple(dict.fromkeys(of))
        """What is drawn as one line each"""
        self._members = [np.flatnonzero([one == group for one in of]) for group in self.groups]
        self._low = np.full((len(self.groups), most), np.inf)
        self._high = -self._low

    def take(self, bins: Counts, starts: Counts, g: Floats) -> None:
        """Take g (N, H) of samples; those from ``starts[k]`` on are of ``bins[k]``."""
        share = g / self._h
        largest = np.stack([share[:, members].max(axis=1) for members in self._members])
        for which, least in ((self._low, np.minimum), (self._high, np.maximum)):
            which[:, bins] = least(which[:, bins], least.reduceat(largest, starts, axis=1))

    def merge(self) -> None:
        """Two bins become one, twice as wide."""
        self._low, self._high = joined(self._low, np.minimum, np.inf), joined(self._high, np.maximum, -np.inf)

    def low(self, group: Group, used: int) -> Floats:
        """The least values in the first bins; NaN: none."""
        return known(self._low[self.groups.index(group), :used])

    def high(self, group: Group, used: int) -> Floats:
        """The largest values in the first bins; NaN: none."""
        return known(self._high[self.groups.index(group), :used])

    def largest(self, cause: str) -> float:
        """g / h of a cause, of all samples."""
        own = [k for k, group in enumerate(self.groups) if group.cause == cause]
        return float(self._high[own].max(initial=0.0))


def _group(cause: str, size: float, parameters: Sequence[str]) -> Group:
    return Group(cause, (1 if size > 0 else -1) if cause in parameters else EITHER)
