"""Alarms from the CUSUM tests: what has changed, since when and by how much.

``events`` are what the kernel reports; ``evidence_builder`` makes evidence of its columns; ``cusum_detector`` turns
both into alarm events.
"""
