"""From files and frames to samples of one axis in SI units, and proposals of what a file or a bus contains.

Each folder imports only from those above it:

* ``roles_by_name``: what a column or signal is by the words of its name; used everywhere below.
* ``tables``: tables of numbers from files.
* ``samples``: from messages of a bus, or columns of a table, to samples of an axis.
* ``records``: records of an axis from files.
* ``roles``: which columns or signals are torque and motion of which axis.
"""
