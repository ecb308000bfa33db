"""Commissioning: what ``axiswatch commission`` does for each axis, from healthy records to a configuration.

* Signals: ``checked_axis``, ``signal_proposals`` (by ``signal_times``, ``signal_units``, ``signal_faults``), and
  ``exchanged_torques``.
* On a bus: ``bus_recording``, ``live_recording``, and ``axis_look`` (shown by ``live_look``, and on the page by
  ``signal_look``).
* An axis: ``axis_commissioning``, with ``commissioning_remedies`` and ``link_load``; several at once:
  ``axis_processes``.
"""
