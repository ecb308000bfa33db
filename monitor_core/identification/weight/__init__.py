"""The torque of weights on an axis: the links that load it, their gear ratios, and the unit of its angle.

``arm_load`` is the search for the load of links: ``gear_ratios``, then ``arm_links`` (terms that the ``link_balance``
rates), and in it ``link_energies``, which chooses from the ``arm_energies`` and, for an arm with a wrist, from those of
its ``arm_chain``.  All solve the ``weight_balance``, as does ``turning_weight``, for the unit.
With the load known, friction shows whether the motor also moves with other axes (``motor_coupling``).
"""
