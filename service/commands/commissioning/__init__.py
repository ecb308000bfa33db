"""From records of a healthy robot to its configuration: what ``axiswatch commission`` does, axis by axis.

Signals: ``checked_axis``, ``signal_proposals`` (by ``signal_units``, ``signal_faults``), ``signal_look`` of the daemon.
On a bus: ``live_look``, ``live_recording``, ``bus_recording``.  An axis: ``axis_commissioning``, with
``commissioning_remedies`` and ``link_load``; several at once: ``axis_processes``.
"""
