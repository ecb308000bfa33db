"""All that a calibration found: what every report is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.calibration.budget import Rates
from monitor_core.calibration.catch import Caught
from monitor_core.calibration.doubts import duration
from monitor_core.calibration.hypotheses import BankLimits
from monitor_core.calibration.scatter import Scatter
from monitor_core.kernel.tables import Floats
from monitor_core.model import AxisModel
from monitor_core.settings import Settings
from service.calibration.reading import Source
from service.config import NamedAxis

FOUND = 0.9
"""A fault counts as found if it is in so many of the onsets."""


@dataclass(frozen=True)
class Provenance:
    """Program, time, command line."""

    version: str
    date: str
    command: str


@dataclass(frozen=True)
class Bank:
    """The bank of hypotheses: its limits, and what it would have caught, in the order of the CUSUM tests' faults."""

    limits: BankLimits
    caught: Sequence[Caught]


@dataclass(frozen=True)
class Calibration:
    """Everything; times in seconds.

    ``settings`` have the thresholds; ``onsets`` is at how many places each fault began; ``caught`` is empty where the
    record is too short for that.
    """

    axis: NamedAxis
    model: AxisModel
    settings: Settings
    budget_s: float
    within_s: float
    scatter: Scatter
    rates: Rates
    allowance: Floats
    caught: Sequence[Caught]
    onsets: int
    sources: Sequence[Source]
    warnings: Sequence[str]
    provenance: Provenance
    bank: Bank | None = None
    """None: the axis can have none"""

    @property
    def between_s(self) -> tuple[float, float, float]:
        """Mean time between false alarms: most likely, and the bounds of the 90 % interval."""
        h, r = self.settings.interval_s, self.rates
        return h / r.whole, h / r.upper, h / r.lower

    @property
    def promise(self) -> str:
        """In one sentence."""
        most, low, high = (duration(v) for v in self.between_s)
        return f"one false alarm in {most}, with 90 % certainty between one in {low} and one in {high}"

    @property
    def bank_between_s(self) -> tuple[float, float, float]:
        """As ``between_s``, of the bank.

        Raises:
            ValueError: there is none.
        """
        if self.bank is None:
            raise ValueError("the axis has no bank of hypotheses")
        h, r = self.settings.interval_s, self.bank.limits
        return h / r.whole, h / r.upper, h / r.lower

    def smallest(self, name: str) -> tuple[float | None, float | None]:
        """Smallest increase and decrease, in sizes, found within the time in 9 of 10; None: none that was tried."""
        return self._smallest(name, 1), self._smallest(name, -1)

    def _smallest(self, name: str, sign: int) -> float | None:
        sizes = [
            abs(one.fault.size)
            for one in self.caught
            if one.fault.parameter == name
            and one.fault.size * sign > 0
            and one.found_within(self.within_s) >= FOUND
        ]
        return sign * min(sizes) if sizes else None

    def confusion(self) -> dict[str, dict[str, int]]:
        """Of each parameter's faults, how many were first called what; "" is no alarm within what was looked at."""
        table = {name: dict.fromkeys((*self.model.monitored, ""), 0) for name in self.model.monitored}
        for one in self.caught:
            for first in one.first:
                table[one.fault.parameter][first] += 1
        return table
