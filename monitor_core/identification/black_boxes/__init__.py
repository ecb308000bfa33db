"""Models without physics to compare a drive with, and to start from: ARX, and frequency responses."""

from monitor_core.identification.black_boxes.arx import Arx, fit_arx
from monitor_core.identification.black_boxes.frequency_response import FrequencyResponse, local_response

__all__ = ["Arx", "FrequencyResponse", "fit_arx", "local_response"]
