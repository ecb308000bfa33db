"""Recursive monitoring of axes: samples in; estimates, status and alarms out."""
