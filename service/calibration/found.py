"""All that a calibration found: what every report is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.arrays import Floats
from monitor_core.calibration.budget import Rates
from monitor_core.calibration.catch import Caught
from monitor_core.calibration.hypotheses import BankLimits
from monitor_core.calibration.scatter import Scatter
from monitor_core.detection.detector_protocol import DetectorName
from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings
from service.calibration.reading import Source
from service.calibration.told import Told
from service.config import NamedAxis


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
    alarms: DetectorName = "cusum"
    """The detector that will alarm, with these thresholds"""

    @property
    def tests(self) -> Told:
        """Of the CUSUM tests."""
        return Told("cusum", self._between(self.rates), self.caught, self.within_s)

    @property
    def by_bank(self) -> Told | None:
        """Of the bank, where the axis can have one."""
        if self.bank is None:
            return None
        return Told("bank", self._between(self.bank.limits), self.bank.caught, self.within_s)

    @property
    def told(self) -> tuple[Told, ...]:
        """Of each detector: first of the one that will alarm."""
        both = [one for one in (self.by_bank, self.tests) if one is not None]
        return tuple(sorted(both, key=lambda one: one.detector != self.alarms))

    def _between(self, rates: Rates | BankLimits) -> tuple[float, float, float]:
        h = self.settings.interval_s
        return h / rates.whole, h / rates.upper, h / rates.lower
