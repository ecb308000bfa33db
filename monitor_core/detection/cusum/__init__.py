"""Alarms from the CUSUM tests: what has changed, since when and by how much.

``cusum_evidence``: what the tests report; ``cusum_detector`` makes alarms of it.
"""
