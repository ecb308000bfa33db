"""From the records of an axis to nominal values and thresholds, each step with what may help where it was refused.

``axis_processes`` does this for all axes in parallel, each by ``commission_axis``: ``coupling_search``,
``axis_identification`` (with ``identification_retries`` and ``load_search``), ``missing_motion``, ``axis_calibration``.
The job is an ``axis_job``.  The steps themselves, which commands do alone, too: ``identification_task`` with its
``identification_records`` (identify), ``calibration_task`` (calibrate), ``planned_motion`` (excite).
"""
