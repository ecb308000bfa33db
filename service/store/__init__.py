"""The state directory: SQLite files with one writer each, and what is kept beside them.

* ``database``: one file, its lock, its migrations, and what becomes of a damaged one.
* ``journal``: the alarms; ``alarm_transitions``, ``alarm_statistics``, ``axis_services``, ``epochs`` and ``audit`` are
  parts of it.
* ``checkpoints``: the states of the monitors.
* ``history_store``, with ``history_rows`` and ``history_query``: the course of all parameters.
* ``outbox``: how far the plant links are.  ``tokens``: who may use the API.  ``archive``: backups of all this.
"""
