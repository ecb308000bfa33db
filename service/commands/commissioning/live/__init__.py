"""On a bus: the signals are checked in a short record (``live_look``), then recorded (``live_recording``).

``axis_look`` has the findings about one axis, which ``signal_look`` shows on the page of a running daemon.
"""
