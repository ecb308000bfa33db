"""The running daemon between the buses and its readers: who owns which state, and in which thread.

* ``worker``: the thread that owns all monitors; start here.  ``bus_readers``: where its frames come from.
* ``axes``: frames to samples to monitors, and what is computed beside the monitors.
* ``persistence``: what is written, and what is read at the start.
* ``publishing`` makes the ``snapshot`` that all readers share; ``silence``: axes whose samples have stopped.
* ``reconfiguration``: other nominal values, or another configuration, while it runs.
* ``kernel_cache`` (compiled code), ``pauses`` (the interpreter lock), ``certificate_watch``: helpers.
"""
