"""A calibration of a configured axis with its origin: the subject of every calibration report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor_core.calibration.result import CalibrationResult, DetectorResult
from monitor_core.detection import DetectorName
from service.config import NamedAxis
from service.ingest.calibration_records import Source


@dataclass(frozen=True)
class Provenance:
    """Program version, time, command line."""

    version: str
    date: str
    command: str


@dataclass(frozen=True)
class Calibration:
    """The result for an axis, its records, and the detector that will raise the alarms with these thresholds."""

    axis: NamedAxis
    result: CalibrationResult
    sources: Sequence[Source]
    warnings: Sequence[str]
    provenance: Provenance
    alarms: DetectorName = "cusum"

    @property
    def detectors(self) -> tuple[DetectorResult, ...]:
        """Performance of each detector, first of the one that will raise the alarms."""
        results = [d for d in (self.result.by_bank, self.result.tests) if d is not None]
        return tuple(sorted(results, key=lambda d: d.detector != self.alarms))
