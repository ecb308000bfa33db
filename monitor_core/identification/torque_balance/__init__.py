"""The axis as one rigid mass: the balance of its torque by linear least squares, without starting values.

* ``torque_windows``: the equations of the balance, and what they leave unexplained with further terms.
* ``rigid_body``: inertia, friction and weight of one mass.
* ``standstill``, ``late_torque``: what else the balance shows.
"""
