"""What the daemon writes, and what it reads at its start.

* ``alarm_recording``: into the journal, by the ``wall_clock``.  ``history_recording``: into the history.
* ``checkpointing``: the state of all monitors.  ``restoring``: what is read of all these at the start.
* ``recording``: samples around alarms and on request, into the ``recording_folder``; ``replay_reports`` of them.
"""
