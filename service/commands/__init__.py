"""The command line: a module for each command (``main.PANELS``), and modules that several of them share.

* Of the command line itself: ``options``, ``daemon_options``, ``output_files``, ``exit_codes``, ``progress``,
  ``signal_handling``.
* The daemon, for ``run`` and ``demo``: ``daemon``, ``daemon_logs``, ``protection``, ``service_manager``;
  ``signal_look`` of ``commissioning/`` for the page.
* For ``identify`` and ``commission``: ``identification_task``, ``identification_records``.  ``planned_motion``: for
  ``excite`` and ``commission``.  ``live_buses``: for ``listen`` and all that listen to buses.
* ``commissioning/``: what ``commission`` does, for each axis, and the checks of its signals.
* The configuration that ``init`` and ``discover`` write: ``proposed_configuration``; ``received_frames``: what they
  look at.
"""
