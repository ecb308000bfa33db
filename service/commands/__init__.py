"""The command line: each module is a command (``main.PANELS``); ``main`` itself is the program.

* ``command_line/``: what several commands share there.
* ``daemon/``: the daemon, for ``run`` and ``demo``.
* ``commissioning/``: what ``commission`` does, for each axis, and the checks of its signals; its steps are those of
  ``identify``, ``calibrate`` and ``excite``, too.
"""
