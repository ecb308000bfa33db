"""Other nominal values, or another configuration, while the daemon runs.

* ``epochs_at_start``: the nominal values of each axis that are valid at the start.
* ``baselines``: those that an operator has found anew.
* ``reloading``: another configuration.
"""
