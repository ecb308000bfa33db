"""The command line: a module for each command (``main.COMMANDS``), and what several of them share.

* Of the command line itself: ``options``, ``daemon_options``, ``output_files``, ``exit_codes``, ``progress``,
  ``signal_handling``, ``sending``.
* The daemon, for ``run`` and ``demo``: ``daemon``, ``daemon_logs``, ``protection``, ``service_manager``,
  ``signal_look``.
* For ``excite``, ``identify`` and ``commission``: ``planned_motion``, ``identification_task``.
* Commissioning of an axis: ``axis_commissioning``, ``commissioning_remedies``, ``link_load``; of several at once:
  ``axis_processes``.  From the bus to a record: ``live_look``, ``live_recording``, ``bus_recording``.
* What records show of the signals: ``checked_axis``, ``signal_proposals``, ``signal_units``, ``signal_faults``.
* What ``init`` and ``discover`` write: ``proposed_configuration``.
"""
