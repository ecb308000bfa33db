"""From the flat equations of a drive to its minimal state space, with no list of variables made by hand.

    flat equations -> substitution of all that an equation of itself gives (substitution.py)
      -> explicit balances of torques (balances.py)
      -> relative angles and speeds as states (states.py, minimal.py)
      -> what no sensor sees left out (pruning.py)

Laurent sums suffice for every drive with one inertia at each node.  Where a sum would have to be divided by, it
becomes a merged parameter (balances.py, for inertias), or all is done again with rational functions (rational.py).
"""

from monitor_core.modeling.elimination.reduce import eliminate

__all__ = ["eliminate"]
