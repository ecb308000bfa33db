"""A robot whose table has the vendor's names and units: from the table to alarms, with no file edited by hand.

Axes of ``tests.core.mismatch``, redrawn: other dynamics, friction and disturbances than the drives of the monitor, and a
drive that warms up without a thermometer.  ``AXISWATCH_AXES`` is their number.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import pytest

pytestmark = pytest.mark.soak

AXES = int(os.environ.get("AXISWATCH_AXES", "6"))
RATED = 50.0
"""Rated torque of the motors [N m]"""
RECORD_S, FAULT_S = 1200.0, 300.0
FAULTS: Mapping[str, Mapping[str, float]] = {"kT": {"kT": 1.2}, "friction": {"fc": 1.5, "fm": 1.5}}
