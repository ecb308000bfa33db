"""Prediction errors of a drive on records, and their gradient: what is free, the held drive, its gain."""

from monitor_core.identification.predictor.prediction_errors import Errors, Predictor

__all__ = ["Errors", "Predictor"]
