"""From healthy records of an axis to thresholds that keep a budget of false alarms, and what they will find.

Read in this order: reading (records as the daemon would see them), running (the whole way), told and found (what
reports are made of).  The method is in monitor_core/calibration.
"""
