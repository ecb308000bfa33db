"""The command line: a module for each command (``main.COMMANDS``), and what several of them share.

* Of the command line itself: ``options``, ``daemon_options``, ``output_files``, ``exit_codes``, ``progress``,
  ``signal_handling``.
* The daemon, for ``run`` and ``demo``: ``daemon``, ``daemon_logs``, ``protection``, ``service_manager``;
  ``signal_look`` of ``commissioning/`` for the page.
* For ``identify`` and ``commission``: ``identification_task``.
* ``commissioning/``: what ``commission`` does, axis by axis, and what records show of the signals.
* What ``init`` and ``discover`` write: ``proposed_configuration``.
"""
