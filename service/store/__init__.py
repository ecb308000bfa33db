"""The state directory: SQLite files with one writer each, tokens and backups.

* ``database``: one file with its lock and migrations, and the quarantine of a damaged file.
* ``journal``: the alarms; ``alarm_filter``, ``alarm_transitions``, ``alarm_statistics``, ``axis_services``, ``epochs``
  and ``audit`` are parts of it.
* ``checkpoints``: the states of the monitors.
* ``history_store``, with ``history_rows`` and ``history_query``: the history of all parameters.
* ``outbox``: which alarm transitions the plant links have delivered.  ``tokens``: who may use the API.
* ``archive``: backups of the configuration and the state directory.
"""
