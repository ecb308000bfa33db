"""Prediction errors of a drive on records, and their gradient: parameter vector, discretized drive, filter gain."""
