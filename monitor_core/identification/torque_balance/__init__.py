"""The axis as one rigid mass: the balance of its torque by linear least squares, without starting values.

* ``torque_windows``: the equations of the balance, and the torque that they do not explain.
* ``rigid_body``: inertia, friction and weight of one mass.
* ``standstill``, ``late_torque``: standstill of the axis, and delay of the torque.
"""
