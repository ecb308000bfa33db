"""From the messages of a bus, or the columns of a table, to samples of one axis in SI units, block by block.

* ``bus_samples``: blocks of frames of a bus to samples of its axes, each by ``axis_input``.
* ``axis_columns``: the same from blocks of rows of a table.
* For both: ``quantities`` (values of torque, motion and auxiliary signals), ``motion_derivatives`` (speed and
  acceleration as signals), ``late_values`` (a torque that is received late), ``unwrap`` (angles that wrap).
* ``timestamp_jitter``: what the time stamps of an axis are like.
* ``encode`` and ``arm_motions``: the inverse, from values of axes to frames.
"""
