"""The pure engine of axiswatch: arrays in, arrays out.

No clock, no file, no thread, no log: time is the sample's own time, so the daemon, a replay of a record and
the tests run exactly the same code.  ``AxisMonitor`` (monitor.py) is the place to start reading.
"""
