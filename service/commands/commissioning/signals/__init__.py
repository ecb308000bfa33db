"""Review of the signals of an axis in its records: faults, and the changes of the configuration that correct them.

``signal_proposals`` has the order of the checks; these are in ``signal_times``, ``signal_units`` and ``signal_faults``,
and look at a ``recorded_axis``.  ``exchanged_torques`` compares all axes of a robot.
"""
