"""From the flat equations of a drive to its minimal state space, without a manual choice of variables.

    flat equations -> substitution of every variable that one equation determines (substitution.py)
      -> explicit balances of torques (balances.py)
      -> relative angles and speeds as states (states.py, minimal.py)
      -> states that no sensor observes are left out (pruning.py)

Laurent sums suffice for every drive with one inertia at each node.  A sum in a denominator becomes a merged parameter
(balances.py, for inertias), or everything is repeated with rational functions (rational.py).
"""

from monitor_core.modeling.elimination.reduce import eliminate

__all__ = ["eliminate"]
