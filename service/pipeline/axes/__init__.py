"""The axes of the daemon: frames to samples to monitors.

* ``axis_monitors`` and ``axis_pipeline``: of all axes and of one.  ``axis_alarms``: the alarms that they change.
* ``epoch_progress``: which nominal values of an axis are in force, learned or verified.
* ``trends``, ``live_signals``: what is computed beside the monitors.
"""
