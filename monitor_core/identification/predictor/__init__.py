"""Prediction errors of a drive on records, and their gradient: what is free, the held drive, its gain."""
