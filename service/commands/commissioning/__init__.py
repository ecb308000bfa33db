"""Commissioning: what ``axiswatch commission`` does, from a healthy robot to a configuration.

The steps, in their order:

1. ``live``: with ``--minutes``, the buses are checked (``live_look``, ``axis_look``) and recorded.
2. ``signals``: the signals of each axis are reviewed in its records; what they show to be wrong becomes a proposal:
   first torques of two axes that are exchanged, then times, units and signs, one after the other.
3. ``axis``: each axis in a process of its own (``axis_processes``) is identified, perhaps repeatedly, a motion is
   planned for what the records do not show, then it is calibrated, and tested in its own records
   (``commission_axis``).
4. ``commission.py``, which calls these steps, writes the report and the configuration.
"""
