"""The axis to calibrate, and how it is monitored."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from monitor_core.drive.axis_model import AxisModel
from monitor_core.settings import Settings

OUT_OF_REACH = 1e30
"""alpha_2 of a test that never alarms."""


class MonitoredAxis(NamedTuple):
    """An axis with its nominal values, and how it is monitored: the first two arguments of an ``AxisMonitor``."""

    model: AxisModel
    settings: Settings

    @property
    def without_tests(self) -> MonitoredAxis:
        """The same axis with tests that never alarm, and so never change the state."""
        settings = replace(self.settings, thresholds=(), alpha2=OUT_OF_REACH, covariance_reset=0.0, run_on=False)
        return self._replace(settings=settings)
