"""What is told of one detector: how often its alarms are false, and what it would have found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.calibration.catch import Caught
from monitor_core.calibration.doubts import duration
from monitor_core.detection.detector_protocol import DetectorName

FOUND = 0.9
"""A fault counts as found if it is in so many of the onsets."""


@dataclass(frozen=True)
class Told:
    """Of the CUSUM tests, or of the bank.

    ``between_s``: mean time between false alarms, most likely, and the bounds of the 90 % interval.  ``caught``: every
    fault that was tried; by the bank with the name that its alarm got, by the tests with that of the first alarm.
    """

    detector: DetectorName
    between_s: tuple[float, float, float]
    caught: Sequence[Caught]
    within_s: float

    @property
    def promise(self) -> str:
        """In one sentence."""
        most, low, high = (duration(v) for v in self.between_s)
        return f"one false alarm in {most}, with 90 % certainty between one in {low} and one in {high}"

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
        """How many faults of each parameter, of all sizes, got which name; "" is no alarm in what was looked at."""
        tried = dict.fromkeys(one.fault.parameter for one in self.caught)
        others = sorted({name for one in self.caught for name in one.first} - {*tried, ""})
        table = {name: dict.fromkeys((*tried, *others, ""), 0) for name in tried}
        for one in self.caught:
            for name in one.first:
                table[one.fault.parameter][name] += 1
        return table
