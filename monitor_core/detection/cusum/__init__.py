"""Alarms from the CUSUM tests, with cause, onset and size.

``cusum_evidence``: events of the tests; ``cusum_detector``: makes alarms of these events.
"""
