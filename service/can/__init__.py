"""CAN: buses, readers, descriptions of messages, log files.

* Live: ``bus`` opens, ``bus_reader`` is the thread of a bus; it takes its frames from ``receivers`` or, faster, from
  ``socket_receivers``.  ``frames``: blocks of frames, as everything here passes them on.
* Decoding: ``decoder``, by a ``decode_plan`` for each message.
* What the messages mean: ``messages``, from ``message_files`` or ``canopen_drives``; for a bus without a description
  ``inferred_layout``.
* Log files: ``log_files`` with ``candump``, ``mf4_frames`` and ``log_bytes`` reads, ``frame_recorder`` writes.
* ``user_errors``: what a user can cause, and how many unreadable parts of a record are tolerated.
"""
