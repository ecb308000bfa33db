"""The job of commissioning one axis, and what its steps share: progress, refusals, the configuration so far."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from monitor_core.calibration import CalibrationError, CalibrationOptions
from monitor_core.excitation import ExcitationError
from monitor_core.identification import IdentificationError
from monitor_core.modeling import ModelError
from service.can.messages import DescriptionError
from service.can.user_errors import IngestError
from service.config import Config, ConfigErrors, NamedAxis
from service.config.axis_settings import AxisError
from service.config.written.commissioned import Found, commissioned, configured, corrected, uncoupled, with_results
from service.config.written.corrections import Correction
from service.reports.commissioning_report import Outcome
from service.reports.formats import Provenance

REFUSALS = (
    *(CalibrationError, IdentificationError, ModelError, DescriptionError, IngestError),
    *(ConfigErrors, AxisError, ExcitationError),
)
"""Errors that end the commissioning of one axis."""
CommissioningProgress = Callable[[str, str, float], None]
"""Called with the phase, "identify" or "calibrate", the present work, and the completed share of it, 0 to 1"""


class AxisJob(NamedTuple):
    """The job for one axis; it can be sent to another process."""

    text: str
    """Text of the configuration, valid in ``folder``"""
    axis_id: str
    records: tuple[str, ...]
    folder: Path
    options: CalibrationOptions
    provenance: Provenance
    shorten: bool
    """If the records do not support the false-alarm budget: use the longest one that they support"""

    def configured(self) -> tuple[Config, NamedAxis]:
        """The configuration and the axis."""
        return configured(self.text, self.axis_id, self.folder)

    def corrected(self, corrections: Sequence[Correction]) -> AxisJob:
        """The job with corrected values of the axis."""
        return self._replace(text=corrected(self.text, self.axis_id, corrections))

    def uncoupled(self) -> AxisJob:
        """The job in which the motion of the axis is that of the arm, as it is sent."""
        return self._replace(text=uncoupled(self.text, self.axis_id))

    def with_results(self, found: Found) -> AxisJob:
        """The job with the results for the axis in its configuration.

        The other axes stay, as angles of axes are part of the pose.
        """
        return self._replace(text=with_results(self.text, self.axis_id, found))

    def alone(self, found: Found) -> AxisJob:
        """The job with the results for the axis in a configuration without the others."""
        return self._replace(text=commissioned(self.text, {self.axis_id: found}))


def as_found(job: AxisJob, outcome: Outcome) -> tuple[Config, NamedAxis]:
    """The configuration with all that was found until now, and the axis."""
    assert outcome.found is not None
    return job.corrected(outcome.corrections).with_results(outcome.found).configured()


def within(phase: str, progress: CommissioningProgress) -> Callable[[str, float, float], None]:
    """The progress of a phase, for functions that report their work, the part that is done, and the total."""
    return lambda work, done, total: progress(phase, work, done / total if total else 0.0)
