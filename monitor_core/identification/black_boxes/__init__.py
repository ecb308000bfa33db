"""Models without physics to compare a drive with, and to start from: ARX, subspace, and frequency responses."""

from monitor_core.identification.black_boxes.arx import Arx, fit_arx
from monitor_core.identification.black_boxes.frequency_response import (
    FrequencyResponse,
    local_response,
    spectral_response,
)
from monitor_core.identification.black_boxes.subspace import Innovations, fit_subspace

__all__ = [
    "Arx", "FrequencyResponse", "Innovations", "fit_arx", "fit_subspace", "local_response",
    "spectral_response",
]  # fmt: skip
