"""The file of a drive's drawing, so that one can see years later whether it is still the same."""

from __future__ import annotations

import hashlib
from pathlib import Path

from service.config import AxisConfig
from service.config.drive_sources import SUFFIX


def drawing_of(axis: AxisConfig) -> tuple[str, str] | None:
    """Name and sha256 of the Modelica file of an axis, None where its drive is of the library or drawn in place."""
    if axis.model.components or not axis.model.drive.endswith(SUFFIX):
        return None
    path = Path(axis.model.drive)
    return path.name, hashlib.sha256(path.read_bytes()).hexdigest()
