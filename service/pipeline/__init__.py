"""The running daemon between the buses and its readers: who owns which state, and in which thread.

* ``worker``: the thread that owns all monitors; start here.  ``bus_readers``: where its frames come from.
* ``axis_monitors`` and ``axis_pipeline``: frames to samples to monitors, of all axes and of one.
* ``alarm_recording`` (of ``axis_alarms``), ``history_recording``, ``checkpointing``, ``recording`` (into the
  ``recording_folder``): what is written.  ``restoring``: what is read at the start.
* ``trends``, ``live_signals``: what is computed beside the monitors.  ``publishing`` makes the ``snapshot`` that all
  readers share.
* ``epoch_progress``, ``epochs_at_start``, ``baselines``, ``reloading``: other nominal values, or another configuration,
  while it runs.
* ``kernel_cache`` (compiled code), ``pauses`` (the interpreter lock), ``wall_clock``, ``replay_reports``: helpers.
"""
