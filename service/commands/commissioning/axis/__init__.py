"""From the records of an axis to nominal values and thresholds, each step with what may help where it was refused.

``axis_processes`` does this for all axes in parallel, each by ``commission_axis``: ``axis_identification`` (with
``identification_retries`` and ``link_load``), ``missing_motion``, ``axis_calibration``.  The task is an ``axis_order``.
"""
